//! Warnings about an outcome.

use std::fmt;
use std::ops::{BitOr, BitOrAssign};

/// A set of warnings about an impact; empty for an ordinary one.
///
/// ```
/// use carom_impact::Flags;
/// let flags = Flags::JAM | Flags::ENERGY_GAIN;
/// assert!(flags.contains(Flags::JAM));
/// assert_eq!(flags.names().collect::<Vec<_>>(), ["energy-gain", "jam"]);
/// assert_eq!(flags.to_string(), "energy-gain, jam");
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Flags(u8);

impl Flags {
    /// No warning.
    pub const NONE: Self = Self(0);
    /// The law increased the kinetic energy, beyond rounding.
    pub const ENERGY_GAIN: Self = Self(1);
    /// Friction jams: `dv_n/dp <= 0` while the contact slips (`μ s B >= C`), so that the normal impulse lowers v_n. It
    /// holds at the start of slip or, in space, where the slip turns into such a direction.
    pub const JAM: Self = Self(1 << 1);
    /// H has a null direction with a normal component, and the outcome depends on it.
    pub const SINGULAR: Self = Self(1 << 2);
    /// The approach is slower than 1e-9 of the contact speed: angles and ratios are dominated by rounding.
    pub const GRAZING: Self = Self(1 << 3);
    /// More than one outcome satisfies the law: [`Law::branches`](crate::Law::branches) returns all of them. Of several contacts:
    /// the velocities depend on how impulses are distributed over redundant contacts, see [`undetermined`](crate::undetermined).
    pub const NON_UNIQUE: Self = Self(1 << 4);
    /// The contact does not approach: no impact takes place, and the impulse is zero.
    pub const NO_APPROACH: Self = Self(1 << 5);
    /// Of several contacts: no impulses satisfy the law with the coefficients of restitution given, and the outcome is that with
    /// all of them zero.
    pub const WITHOUT_RESTITUTION: Self = Self(1 << 6);

    const NAMES: [(Self, &'static str); 7] = [
        (Self::ENERGY_GAIN, "energy-gain"),
        (Self::JAM, "jam"),
        (Self::SINGULAR, "singular"),
        (Self::GRAZING, "grazing"),
        (Self::NON_UNIQUE, "non-unique"),
        (Self::NO_APPROACH, "no-approach"),
        (Self::WITHOUT_RESTITUTION, "without-restitution"),
    ];

    /// Whether every flag of `other` is set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether no flag is set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Names of the flags set, in a fixed order.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(flag, _)| self.contains(*flag)).map(|(_, name)| name)
    }

    /// The flags as bits, in the order of [`Flags::names`].
    ///
    /// ```
    /// # use carom_impact::Flags;
    /// assert_eq!((Flags::ENERGY_GAIN | Flags::GRAZING).bits(), 0b1001);
    /// ```
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The flags of [`Flags::bits`]; bits without a flag are left out.
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & ((1 << Self::NAMES.len()) - 1))
    }

    /// This flag if `condition` holds, else none.
    pub(crate) const fn when(self, condition: bool) -> Self {
        if condition { self } else { Self::NONE }
    }
}

impl BitOr for Flags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, name) in self.names().enumerate() {
            if i > 0 {
                f.write_str(", ")?;
            }
            f.write_str(name)?;
        }
        Ok(())
    }
}

impl fmt::Debug for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Flags({self})")
    }
}
