//! Errors: a code for programs and a text for readers.

use std::fmt::{self, Display, Formatter};

/// A fallible value.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The kind of an error, with the number that C programs get. 0 is success.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorCode {
    /// A pointer is NULL.
    NullPointer = 1,
    /// The id belongs to no motor: it is null, or its motor was destroyed.
    BadId = 2,
    /// No more motors fit.
    TooMany = 3,
    /// A motor file or a preset cannot be read, or describes no motor.
    BadFile = 4,
    /// No variable has this name or number.
    UnknownVariable = 5,
    /// The value is not allowed.
    BadValue = 6,
    /// The variable cannot be set, or not anymore.
    NotSettable = 7,
    /// The time is not finite, or before the present time of the motor.
    BadTime = 8,
    /// Both gates of a leg are on.
    ShootThrough = 9,
    /// The function needs `inverter.mode` = 2 (Switched).
    NeedsSwitched = 10,
    /// The parameters contradict each other.
    Inconsistent = 11,
    /// The motor has no state at this time: it became too fast, or is no longer finite.
    Failed = 12,
    /// A panic ended the call: a bug of this library. The motor can only be destroyed.
    Panicked = 13,
}

impl ErrorCode {
    /// Every code.
    pub const ALL: &[Self] = &[
        Self::NullPointer,
        Self::BadId,
        Self::TooMany,
        Self::BadFile,
        Self::UnknownVariable,
        Self::BadValue,
        Self::NotSettable,
        Self::BadTime,
        Self::ShootThrough,
        Self::NeedsSwitched,
        Self::Inconsistent,
        Self::Failed,
        Self::Panicked,
    ];
}

/// Why a call was refused. The call has changed nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    code: ErrorCode,
    text: String,
}

impl Error {
    /// An error with this text.
    pub fn new(code: ErrorCode, text: impl Display) -> Self {
        Self { code, text: text.to_string() }
    }

    /// An argument with a value that is not allowed.
    pub(crate) fn value(code: ErrorCode, name: impl Display, value: impl Display, allowed: impl Display) -> Self {
        Self::new(code, format_args!("{name} = {value} is not allowed: {allowed}"))
    }

    /// The kind of the error.
    pub fn code(&self) -> ErrorCode {
        self.code
    }
}

impl Display for Error {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Error {}
