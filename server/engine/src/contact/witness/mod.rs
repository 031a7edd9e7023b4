//! Contacts that are solved for: Newton on the faces that hold one, what was found, and its features.
//!
//! | file | |
//! |---|---|
//! | `contacts` | from a guess to a confirmed contact; which of several is kept |
//! | `newton` | the contact's equations, solved for a few literals |
//! | `balance` | the same equations at one instant: where faces are deepest in each other |
//! | `known` | which faces a contact may be solved for |
//! | `faces` | the faces that hold a point of a primitive along a direction |
//! | `found` | a contact that was found, and how a search ends |
//! | `touch` | from the witness back to where the surfaces touch, by equations |
//! | `retreat` | the same where no equations lead there, by climbs |
//! | `climb` | a witness where a search does not end by itself |
//! | `features` | which faces both bodies show at the contact |
//! | `dependence` | on which of the literals at a point f depends |
//! | `sides` | which literals of two bodies decide |
//! | `extent` | whether the faces leave a point, a line or a patch |

pub mod balance;
pub mod climb;
pub mod contacts;
mod dependence;
pub mod extent;
pub mod faces;
pub mod features;
pub mod found;
pub mod known;
pub mod newton;
pub mod retreat;
mod sides;
pub mod touch;
