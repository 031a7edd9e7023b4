//! Error codes that never change their number, each with its sentence.
//!
//! Codes travel in step replies and control answers; the sentence is made where it is read. New codes are appended.

use std::fmt;

macro_rules! codes {
    ($($number:literal $variant:ident $sentence:literal),+ $(,)?) => {
        /// Why a request was refused. The number is stable across versions.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum ErrorCode { $(#[doc = $sentence] $variant = $number),+ }

        impl ErrorCode {
            /// All codes in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The code of a number on the wire; `None` for 0 (no error) and for numbers this version does not know.
            pub fn of_number(number: u32) -> Option<Self> {
                match number { $($number => Some(Self::$variant),)+ _ => None }
            }

            /// One sentence without place or full stop.
            pub fn sentence(self) -> &'static str {
                match self { $(Self::$variant => $sentence),+ }
            }
        }
    };
}

codes! {
    1 Version "the server speaks another version of the protocol",
    2 SessionGone "the session does not exist on this server (any more)",
    3 UnknownObject "there is no object of this id in the session",
    4 DuplicateObject "the object is named twice",
    5 StaticObject "the object is static and cannot be moved",
    6 NotFinite "a position or rotation is not a finite number, or is farther than 1e150 away",
    7 BadQuaternion "the quaternion is not of unit length (its squared norm is off by more than 0.001)",
    8 BadCount "the batch is malformed: its record count or its flags are not of the protocol",
    9 TooMany "the batch has more records than the server's limit",
    10 Declaration "the motion breaks what was declared of the object (no rotation, or a largest speed)",
    11 Resolution "the resolution is not a positive length well below the smallest dimension of the primitives",
    12 LimitText "the model's text is longer than the server's limit",
    13 LimitNodes "the model's tree has more nodes than the server's limit",
    14 LimitDepth "the model's tree is deeper than the server's limit",
    15 LimitFaces "the model has more faces than the server's limit",
    16 LimitObjects "the session has as many objects as the server allows",
    17 LimitSessions "the server has as many sessions as it allows",
    18 LimitMemory "the request needs more memory than the server's limit",
    19 Busy "the server is busy with an earlier request of this session",
    20 Internal "the server failed internally",
    21 UnknownModel "there is no model of this id in the session",
    22 Model "the model cannot be imported",
    23 BadRule "the rule is not valid",
    24 BadCommand "the command cannot be decoded",
    25 BadNumber "an option of the request is out of its range",
    26 Unbounded "the model reaches to infinity",
    27 SessionEnded "the session was ended on its server, with `contactd sessions end`",
    28 Recording "what was asked cannot be recorded or saved",
}

impl ErrorCode {
    /// The number on the wire.
    pub fn number(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.sentence())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_consecutive_and_come_back() {
        for (i, code) in ErrorCode::ALL.iter().enumerate() {
            assert_eq!(code.number(), i as u32 + 1);
            assert_eq!(ErrorCode::of_number(code.number()), Some(*code));
            assert!(!code.sentence().ends_with('.') && code.sentence().len() > 10);
        }
        assert_eq!(ErrorCode::of_number(0), None);
    }
}
