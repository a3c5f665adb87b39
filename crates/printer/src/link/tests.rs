//! The link against a board at the end of a bad line.
