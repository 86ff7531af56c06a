//! All laws of this crate, from the rows of their table: their list, and any of them as one type.

use nalgebra::SVector;

use super::brach::BrachTowardsRest;
use super::*;
use crate::flow::Found;

/// A law of this crate, as lists and help texts show it: an entry of [`LAWS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LawInfo {
    /// Its name, one of [`LAW_NAMES`].
    pub name: &'static str,
    /// Other names, which are read but not written, such as that of the author.
    pub aliases: &'static [&'static str],
    /// What it is, in a line of 70 columns at most.
    pub summary: &'static str,
    /// The fields of [`Coefficients`] that it uses.
    pub coefficients: &'static [&'static str],
}

impl LawInfo {
    /// The law called `name`, or with this alias; `None` if there is none.
    ///
    /// ```
    /// assert_eq!(carom_impact::LawInfo::named("stronge").unwrap().name, "energetic");
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        LAWS.into_iter().find(|law| law.name == name || law.aliases.contains(&name))
    }

    /// Whether the law uses a coefficient, by the name of the field of [`Coefficients`].
    pub fn has(&self, coefficient: &str) -> bool {
        self.coefficients.contains(&coefficient)
    }
}

/// The law called `name`, or with this alias; `None` if there is none. The coefficients are checked when the law resolves its first
/// problem; coefficients that the law does not have are ignored.
///
/// ```
/// use carom_impact::{Coefficients, LAW_NAMES, law_by_name};
/// let coefficients = Coefficients { restitution: 0.5, friction: 0.2, ..Coefficients::default() };
/// for name in LAW_NAMES {
///     assert_eq!(law_by_name::<3>(name, coefficients).unwrap().name(), name);
/// }
/// assert!(law_by_name::<2>("hertz", coefficients).is_none());
/// ```
pub fn law_by_name<const D: usize>(
    name: &str,
    coefficients: Coefficients,
) -> Option<Box<dyn Law<f64, D> + Send + Sync>> {
    Some(Box::new(AnyLaw::named(name, coefficients)?))
}

/// Any law of this crate with its coefficients, as one type that can be converted to another scalar type.
///
/// ```
/// use carom_impact::{AnyLaw, Coefficients, Energetic, Law};
/// let law: &dyn Law<f64, 2> = &Energetic { restitution: 0.5, friction: 0.2 };
/// let law = law.known().unwrap();
/// assert_eq!(law.coefficients().friction, 0.2);
/// let harder = law.with(Coefficients { restitution: 0.9, ..law.coefficients() });
/// assert_eq!(harder.coefficients().restitution, 0.9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnyLaw<T = f64>(Kind<T>);

/// A type of the rows of the table.
pub trait Own: Copy {
    type Scalar: RealField + Copy;

    fn any(self) -> AnyLaw<Self::Scalar>;
}

macro_rules! own {
    ($name:expr, $law:ident) => {
        impl<T> $law<T> {
            pub(crate) const NAME: &'static str = $name;
        }

        impl<T: RealField + Copy> Own for $law<T> {
            type Scalar = T;

            #[inline]
            fn any(self) -> AnyLaw<T> {
                AnyLaw(Kind::$law(self))
            }
        }
    };
}

/// Everything that has one case for each law.
macro_rules! laws {
    ($($(#[$doc:meta])* $name:literal $(| $alias:literal)* $law:ident { $($coefficient:ident),* } $summary:literal;)*) => {
        /// The laws of this crate.
        ///
        /// ```
        /// use carom_impact::LAWS;
        /// let tangential = LAWS.into_iter().filter(|law| law.has("tangential_restitution"));
        /// assert!(tangential.map(|law| law.name).eq(["chatterjee-ruina"]));
        /// ```
        pub const LAWS: [LawInfo; [$($name),*].len()] = [$(LawInfo {
            name: $name,
            aliases: &[$($alias),*],
            summary: $summary,
            coefficients: &[$(stringify!($coefficient)),*],
        }),*];

        /// Names of the laws. [`law_by_name`] accepts their aliases ([`LawInfo::aliases`]) too.
        pub const LAW_NAMES: [&str; LAWS.len()] = [$($name),*];

        #[derive(Debug, Clone, Copy, PartialEq)]
        enum Kind<T> {
            $($law($law<T>),)*
            /// With a prescribed ratio instead of a coefficient of friction.
            Brach(Brach<T>),
        }

        impl<T: RealField + Copy> AnyLaw<T> {
            /// The law called `name`, or `None` if there is none; see [`law_by_name`].
            #[doc(hidden)]
            pub fn named(name: &str, coefficients: Coefficients<T>) -> Option<Self> {
                Some(Self(match name {
                    $($name $(| $alias)* => Kind::$law($law { $($coefficient: coefficients.$coefficient),* }),)*
                    _ => return None,
                }))
            }

            /// The coefficients of the law; zero for those that it does not have. For [`Brach`] `friction` is the absolute
            /// value of the impulse ratio.
            pub fn coefficients(&self) -> Coefficients<T> {
                let zero = T::zero();
                let mut own = Coefficients { restitution: zero, tangential_restitution: zero, friction: zero };
                match self.0 {
                    $(Kind::$law(law) => {
                        $(own.$coefficient = law.$coefficient;)*
                    })*
                    Kind::Brach(Brach { restitution, impulse_ratio }) => {
                        (own.restitution, own.friction) = (restitution, impulse_ratio.abs());
                    }
                }
                own
            }

            /// The same law with other coefficients, of any scalar type. [`Brach`] keeps the sign of its impulse ratio.
            pub fn with<U: RealField + Copy>(&self, coefficients: Coefficients<U>) -> AnyLaw<U> {
                AnyLaw(match self.0 {
                    $(Kind::$law(_) => Kind::$law($law { $($coefficient: coefficients.$coefficient),* }),)*
                    Kind::Brach(Brach { impulse_ratio, .. }) => {
                        let Coefficients { restitution, friction, .. } = coefficients;
                        let impulse_ratio = if impulse_ratio < T::zero() { -friction } else { friction };
                        Kind::Brach(Brach { restitution, impulse_ratio })
                    }
                })
            }

            pub(crate) fn family<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Family<T> {
                match &self.0 {
                    $(Kind::$law(law) => law.family(problem),)*
                    Kind::Brach(law) => law.family(problem),
                }
            }
        }

        impl<T: RealField + Copy, const D: usize> Law<T, D> for AnyLaw<T> {
            fn name(&self) -> &'static str {
                match self.0 {
                    $(Kind::$law(_) => $name,)*
                    Kind::Brach(_) => Brach::<T>::NAME,
                }
            }

            #[inline]
            fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
                match &self.0 {
                    $(Kind::$law(law) => Rule::resolve(law, problem),)*
                    Kind::Brach(law) => Rule::resolve(law, problem),
                }
            }

            fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
                match &self.0 {
                    $(Kind::$law(law) => Rule::branches(law, problem),)*
                    Kind::Brach(law) => Rule::branches(law, problem),
                }
            }

            fn known(&self) -> Option<AnyLaw<T>> {
                Some(*self)
            }
        }

        $(own! { $name, $law })*
    };
}

crate::law_table! { laws! }
own! { BrachTowardsRest::<()>::NAME, Brach }

impl<T: RealField + Copy, L: Own<Scalar = T>> From<L> for AnyLaw<T> {
    fn from(law: L) -> Self {
        law.any()
    }
}

impl<T: RealField + Copy, L: Own<Scalar = T>, const D: usize> Law<T, D> for L {
    fn name(&self) -> &'static str {
        Law::<T, D>::name(&self.any())
    }

    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        self.any().resolve(problem)
    }

    fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        self.any().branches(problem)
    }

    fn known(&self) -> Option<AnyLaw<T>> {
        Some(self.any())
    }
}

impl<T: RealField + Copy> AnyLaw<T> {
    /// The path of an impact whose slip turns in space, for a law that follows it in time; `None` for others.
    pub(crate) fn turning<const D: usize>(
        &self,
        problem: &ImpactProblem<T, D>,
    ) -> Result<Option<Found<T, D>>, ImpactError> {
        self.family(problem).path().map_or(Ok(None), |path| path.turning(problem))
    }

    /// The impulse alone, without the energies, works and flags of an outcome.
    pub(crate) fn impulse<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<SVector<T, D>, ImpactError> {
        match self.family(problem).path() {
            Some(path) => path.impulse(problem),
            None => Ok(self.resolve(problem)?.impulse),
        }
    }
}
