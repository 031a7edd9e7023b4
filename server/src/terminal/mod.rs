//! Text for a terminal: lines of 80 columns, numbers without noise, colour where it is wanted.
//!
//! A column is a character: what a terminal draws twice as wide is not told apart.
//!
//! Floor 8: imports nothing.

mod layout;
mod number;
mod paint;

pub use layout::{Piece, WIDTH, aligned, clean, cut, fold, sentence, width};
pub use number::{number, time};
pub use paint::{Colour, Paint, Role};
