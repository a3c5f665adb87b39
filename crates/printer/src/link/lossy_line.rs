//! A board at the end of a bad line, in virtual time, for tests.
