//! Enumerations: from numbers to values and back.

use super::{InvalidField, Result};
use crate::v1;
use proto::prediction::MotionCommandKind;
use proto::types::{Coupling, DeliveryColumn, Medium, MoteCommandKind, NetRecord};

/// An enumeration of the contract. Its number 0 is that of nothing stated.
pub trait Numbered: Copy + Sized {
    /// The number of the value.
    fn number(self) -> i32;

    /// The value of a number, if this version of the contract knows it.
    fn of_number(number: i32) -> Option<Self>;
}

/// Values have the same names in messages.
macro_rules! numbered {
    ($($name:ident { $($value:ident),+ })+) => {$(
        impl From<$name> for v1::$name {
            fn from(value: $name) -> Self {
                match value {
                    $($name::$value => Self::$value,)+
                }
            }
        }

        impl Numbered for $name {
            fn number(self) -> i32 {
                v1::$name::from(self).into()
            }

            fn of_number(number: i32) -> Option<Self> {
                match v1::$name::try_from(number).ok()? {
                    $(v1::$name::$value => Some(Self::$value),)+
                    v1::$name::Unspecified => None,
                }
            }
        }
    )+};
}

numbered! {
    Coupling { Sequential, Parallel, Event }
    DeliveryColumn { ReceivedNs, RssiDbm, Hops, Medium }
    Medium { Radio, Truth, Second }
    MoteCommandKind { Kill, Revive, Add, Jam, Send }
    MotionCommandKind { Velocity, SpeedAndYawRate, SpeedAndSteering }
    NetRecord { Packets, Capture, Statistics, Schedule, HeardLinks, Frames }
}

/// The numbers of values.
pub fn numbers<T: Numbered>(values: &[T]) -> Vec<i32> {
    values.iter().map(|value| value.number()).collect()
}

/// The values of those numbers that this version of the contract knows.
#[must_use]
pub fn known<T: Numbered>(numbers: &[i32]) -> Vec<T> {
    numbers.iter().filter_map(|&number| T::of_number(number)).collect()
}

/// Coupling from its number; not stated means sequential.
///
/// # Errors
///
/// A number that the contract does not know.
pub fn coupling(number: i32) -> Result<Coupling> {
    let known = if number == 0 { Some(Coupling::Sequential) } else { Coupling::of_number(number) };
    known.ok_or_else(|| InvalidField::new("coupling", format!("is unknown: {number}")))
}

/// Delivery columns from their numbers.
///
/// # Errors
///
/// A number that the contract does not know.
pub fn columns(numbers: &[i32]) -> Result<Vec<DeliveryColumn>> {
    all_known("columns", "column", numbers)
}

/// Kinds of record from their numbers.
///
/// # Errors
///
/// A number that the contract does not know.
pub fn records(numbers: &[i32]) -> Result<Vec<NetRecord>> {
    all_known("records", "record", numbers)
}

fn all_known<T: Numbered>(field: &str, what: &str, numbers: &[i32]) -> Result<Vec<T>> {
    let value = |&number: &i32| {
        let unknown = || InvalidField::new(field, format!("unknown {what}: {number}"));
        T::of_number(number).ok_or_else(unknown)
    };
    numbers.iter().map(value).collect()
}

/// A kind of command from its number.
///
/// # Errors
///
/// It is not stated, or this version of the contract does not know it.
pub fn motion_command_kind(number: i32) -> Result<MotionCommandKind> {
    MotionCommandKind::of_number(number).ok_or_else(|| {
        InvalidField::new("command_kind", format!("must be 1, 2 or 3, got {number}"))
    })
}
