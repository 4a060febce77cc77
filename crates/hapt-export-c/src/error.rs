//! Why a world is not written as C.

use std::fmt;

/// Why a world is not written as C.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The core does not compile it, or not into the capacity of a C file.
    Core(hapt_core::Error),
    /// A number that the C's numbers cannot hold.
    Number {
        /// Which of the compiled world's.
        name: &'static str,
        /// Its value.
        given: f64,
    },
    /// A number that the C cannot change.
    Tune {
        /// Its key.
        key: String,
        /// Why not.
        why: &'static str,
    },
    /// A prefix that is no name in C, or one that C and its libraries use themselves.
    Prefix {
        /// The given text.
        given: String,
        /// A right one.
        wanted: &'static str,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Core(error) => write!(f, "{error}"),
            Error::Number { name, given } => {
                write!(
                    f,
                    "float cannot hold the compiled world's {name} of {given:e}: --float f64 can, or other units of scale"
                )
            }
            Error::Tune { key, why } => write!(f, "--tune {key}: {why}"),
            Error::Prefix { given, wanted } => write!(f, "{given:?} cannot begin the names in C: {wanted}"),
        }
    }
}

impl std::error::Error for Error {}

impl From<hapt_core::Error> for Error {
    fn from(error: hapt_core::Error) -> Self {
        Error::Core(error)
    }
}
