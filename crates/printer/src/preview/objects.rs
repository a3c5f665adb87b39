//! The objects that a file names (`M486`, `EXCLUDE_OBJECT_*`), numbered as the vertices have them.
//!
//! Knows names, not outlines: bounded by [`OBJECTS_MAX`], whatever a file defines. mm.

use std::collections::HashMap;

use gcode::{ObjectAction, ObjectId};
use units::Mm;

/// So many are told apart.
pub const OBJECTS_MAX: usize = 254;
/// The number of one beyond those.
const BEYOND: u8 = 255;
/// The longest name that is told.
const NAME_BYTES_MAX: usize = 128;

/// An object of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectReport {
    /// As the file calls it.
    pub name: String,
    /// Its middle on the bed, in G-code's coordinates, where the file gives it.
    pub centre_mm: Option<[f64; 2]>,
    /// Filament laid for it.
    pub filament: Mm,
}

/// Numbers objects in the order in which the file names them first.
#[derive(Debug, Default)]
pub(super) struct Objects {
    numbers: HashMap<ObjectId, u8>,
    list: Vec<ObjectReport>,
    /// The one in hand; 0 is none.
    pub(super) current: u8,
}

fn shortened(name: &str) -> String {
    let mut end = name.len().min(NAME_BYTES_MAX);
    while !name.is_char_boundary(end) {
        end -= 1;
    }
    name[..end].to_owned()
}

impl Objects {
    /// What a line of the file says of objects.
    pub(super) fn act(&mut self, action: ObjectAction) {
        match action {
            ObjectAction::Define { id, label, centre, .. } => {
                let number = self.number(id);
                let Some(object) = self.object(number) else { return };
                object.centre_mm = centre.or(object.centre_mm);
                if let Some(label) = label {
                    object.name = shortened(&label);
                }
            }
            ObjectAction::Start(id) => self.current = self.number(id),
            ObjectAction::End(_) => self.current = 0,
            ObjectAction::Count(_) | ObjectAction::Cancel(_) | ObjectAction::Restore(_) => {}
        }
    }

    /// Filament has been laid.
    pub(super) fn lay(&mut self, filament_mm: f64) {
        if let Some(object) = self.object(self.current) {
            object.filament = Mm(object.filament.0 + filament_mm);
        }
    }

    fn object(&mut self, number: u8) -> Option<&mut ObjectReport> {
        usize::from(number).checked_sub(1).and_then(|at| self.list.get_mut(at))
    }

    fn number(&mut self, id: ObjectId) -> u8 {
        if let Some(&number) = self.numbers.get(&id) {
            return number;
        }
        if self.list.len() == OBJECTS_MAX {
            return BEYOND;
        }
        let name = match &id {
            ObjectId::Name(name) => shortened(name),
            ObjectId::Index(index) => format!("#{index}"),
        };
        self.list.push(ObjectReport { name, centre_mm: None, filament: Mm::ZERO });
        let number = self.list.len() as u8;
        self.numbers.insert(id, number);
        number
    }

    /// All of them; the first has number 1.
    pub(super) fn into_list(self) -> Vec<ObjectReport> {
        self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_bounded() {
        let mut objects = Objects::default();
        for index in 0..1000 {
            objects.act(ObjectAction::Start(ObjectId::Index(index)));
            assert_eq!(usize::from(objects.current), (index as usize + 1).min(255));
            objects.lay(1.0);
        }
        objects.act(ObjectAction::Start(ObjectId::Index(7)));
        assert_eq!(objects.current, 8);
        objects.act(ObjectAction::End(None));
        assert_eq!(objects.current, 0);
        let label = Some("ü".repeat(500));
        objects.act(ObjectAction::Define { id: ObjectId::Index(7), label, centre: None, polygon: vec![] });
        let list = objects.into_list();
        assert_eq!(list.len(), OBJECTS_MAX);
        assert_eq!(list[7].name, "ü".repeat(NAME_BYTES_MAX / 2));
        assert!(list.iter().all(|object| object.filament == Mm(1.0)));
        assert_eq!(list[3].name, "#3");
    }
}
