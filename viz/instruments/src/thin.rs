//! Fewer points for the same picture: of all points in one column of pixels, the first, the lowest, the highest and
//! the last are drawn, so that no peak is lost. (M4: Jugel et al., VLDB 2014.)

/// A point: time, value.
pub type Point = [f64; 2];

/// The points that are worth drawing where a column of pixels is `column_s` seconds wide; at most four a column.
///
/// Columns begin at multiples of `column_s`, not at the first point, so that a picture that moves does not flicker.
/// `points` are in the order of time.
pub fn thinned(points: impl IntoIterator<Item = Point>, column_s: f64) -> Vec<Point> {
    let mut drawn = Vec::new();
    let mut column: Option<(f64, Column)> = None;
    for point in points {
        let index = (point[0] / column_s).floor();
        match &mut column {
            Some((same, open)) if *same == index => open.take(point),
            _ => {
                if let Some((_, done)) = column.replace((index, Column::of(point))) {
                    done.draw(&mut drawn);
                }
            }
        }
    }
    if let Some((_, done)) = column {
        done.draw(&mut drawn);
    }
    drawn
}

struct Column {
    first: Point,
    low: Point,
    high: Point,
    last: Point,
}

impl Column {
    fn of(point: Point) -> Self {
        Self { first: point, low: point, high: point, last: point }
    }

    fn take(&mut self, point: Point) {
        if point[1] < self.low[1] {
            self.low = point;
        }
        if point[1] > self.high[1] {
            self.high = point;
        }
        self.last = point;
    }

    fn draw(self, drawn: &mut Vec<Point>) {
        let (one, other) =
            if self.low[0] <= self.high[0] { (self.low, self.high) } else { (self.high, self.low) };
        let from = drawn.len();
        for point in [self.first, one, other, self.last] {
            if drawn.len() == from || drawn.last() != Some(&point) {
                drawn.push(point);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_stay_as_they_are() {
        let points = [[0.0, 1.0], [1.0, 3.0], [2.0, 2.0]];
        assert_eq!(thinned(points, 0.5), points);
        assert_eq!(thinned([], 0.5), Vec::<Point>::new());
    }

    #[test]
    fn ends_and_extremes_of_a_column_are_kept_in_order() {
        let points = [[0.0, 5.0], [0.1, 6.0], [0.2, 9.0], [0.3, 1.0], [0.4, 2.0], [0.9, 3.0]];
        assert_eq!(thinned(points, 1.0), [[0.0, 5.0], [0.2, 9.0], [0.3, 1.0], [0.9, 3.0]]);
    }

    #[test]
    fn a_short_peak_among_many_points_survives_and_the_number_is_bounded() {
        let points = (0..7200).map(|i| [f64::from(i), if i == 4321 { 300.0 } else { f64::from(i % 3) }]);
        let drawn = thinned(points, 7200.0 / 320.0);
        assert!(drawn.len() <= 4 * 321, "{}", drawn.len());
        assert!(drawn.contains(&[4321.0, 300.0]));
        assert!(drawn.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
    }

    #[test]
    fn what_is_drawn_does_not_depend_on_where_the_window_begins() {
        let all: Vec<Point> = (0..1000).map(|i| [f64::from(i), f64::from(i * 7919 % 101)]).collect();
        let from_500: Vec<Point> = all.iter().copied().filter(|point| point[0] >= 500.0).collect();
        let whole: Vec<Point> = thinned(all, 10.0).into_iter().filter(|point| point[0] >= 500.0).collect();
        assert_eq!(thinned(from_500, 10.0), whole);
    }
}
