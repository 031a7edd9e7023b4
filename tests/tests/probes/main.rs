//! Points and rays against solids: held to closed forms, to brute force on random trees of all kinds, and through a session's world.

mod by_hand;
mod closed;
mod far;
mod judge;
mod points;
mod rays;
mod worlds;
