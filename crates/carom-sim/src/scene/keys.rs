//! Groups of keys, which several tables of scene and study files share.

use carom_chain::urdf::LoadOptions;
use serde::de::{DeserializeSeed, Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// A group of keys. A pair of groups is a group.
pub trait Keys: Default {
    /// All keys.
    fn names() -> Vec<&'static str>;

    /// The keys that a table must have.
    fn required() -> Vec<&'static str>;

    /// Reads the value of a key; `false` if the key is not of this group.
    ///
    /// # Errors
    /// A value of another type.
    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, from: &mut A) -> Result<bool, A::Error>;
}

impl<K: Keys, L: Keys> Keys for (K, L) {
    fn names() -> Vec<&'static str> {
        [K::names(), L::names()].concat()
    }

    fn required() -> Vec<&'static str> {
        [K::required(), L::required()].concat()
    }

    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, from: &mut A) -> Result<bool, A::Error> {
        Ok(self.0.read(key, from)? || self.1.read(key, from)?)
    }
}

/// A table of the file with these keys and no others.
#[derive(Default)]
pub struct Table<K>(pub K);

impl<'de, K: Keys> Deserialize<'de> for Table<K> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_map(Reader(PhantomData)).map(Self)
    }
}

struct Reader<K>(PhantomData<K>);

impl<'de, K: Keys> Visitor<'de> for Reader<K> {
    type Value = K;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut from: A) -> Result<K, A::Error> {
        let (mut keys, mut missing) = (K::default(), K::required());
        while let Some(key) = from.next_key_seed(Known(K::names()))? {
            keys.read(&key, &mut from)?;
            missing.retain(|name| *name != key);
        }
        missing.first().map_or(Ok(keys), |name| Err(Error::missing_field(name)))
    }
}

/// Reads one of these keys: the error about another one has the place of the key.
struct Known(Vec<&'static str>);

impl<'de> DeserializeSeed<'de> for Known {
    type Value = String;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<String, D::Error> {
        from.deserialize_identifier(self)
    }
}

impl Visitor<'_> for Known {
    type Value = String;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<String, E> {
        if self.0.contains(&key) {
            return Ok(key.to_owned());
        }
        let known = self.0.join("`, `");
        Err(E::custom(format_args!("unknown field `{key}`, expected one of `{known}`")))
    }
}

/// Defines groups of keys with their types and defaults; those after `needs` are required. Each group also lists the keys that are
/// given, and is read from a table with its keys and no others.
#[doc(hidden)]
#[macro_export]
macro_rules! key_group {
    (@default) => { Default::default() };
    (@default $default:expr) => { $default };
    ($($(#[$meta:meta])* $vis:vis struct $name:ident needs [$($needed:ident),*] {
        $($(#[$doc:meta])* $key:ident: $type:ty $(= $default:expr)?,)*
    })+) => {$(
        $(#[$meta])*
        $vis struct $name {
            $($(#[$doc])* pub $key: $type,)*
            /// The keys that are given.
            pub given: Vec<&'static str>,
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $crate::key_group!(@default $($default)?),)* given: Vec::new() }
            }
        }

        impl $crate::keys::Keys for $name {
            fn names() -> Vec<&'static str> {
                vec![$(stringify!($key)),*]
            }

            fn required() -> Vec<&'static str> {
                vec![$(stringify!($needed)),*]
            }

            fn read<'de, A: serde::de::MapAccess<'de>>(&mut self, key: &str, from: &mut A) -> Result<bool, A::Error> {
                match key {
                    $(stringify!($key) => {
                        self.$key = from.next_value()?;
                        self.given.push(stringify!($key));
                    })*
                    _ => return Ok(false),
                }
                Ok(true)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                Ok($crate::keys::Table::deserialize(from)?.0)
            }
        }
    )+};
}

key_group! {
    /// How a robot is read from its file: of `[robot]` and `[[robot]]` in scenes and of `[robot]` in studies.
    pub struct Loading needs [urdf] {
        /// The file.
        urdf: PathBuf,
        /// The link that is the tip.
        tip: String = TIP.to_owned(),
        /// As in [`LoadOptions`].
        strict: bool,
        /// As in [`LoadOptions`].
        repair: bool,
        /// As in [`LoadOptions`], relative to the folder of the scene or study.
        package_dirs: Vec<PathBuf>,
        /// As in [`LoadOptions`].
        rotor_inertia: BTreeMap<String, f64>,
        /// As in [`LoadOptions`].
        mass: BTreeMap<String, f64>,
        /// As in [`LoadOptions`].
        inertia: BTreeMap<String, Numbers<6>>,
    }
}

/// The tip of a robot that names none.
pub(crate) const TIP: &str = "tip";

impl Loading {
    /// The file and the options to read it with, where file names are relative to this folder.
    ///
    /// # Errors
    /// A file without a name.
    pub fn options(&self, folder: &Path) -> Result<(PathBuf, LoadOptions), String> {
        if self.urdf.as_os_str().is_empty() {
            return Err("urdf is empty: give the path of the file".into());
        }
        let options = LoadOptions {
            strict: self.strict,
            repair: self.repair,
            package_dirs: self.package_dirs.iter().map(|dir| folder.join(dir)).collect(),
            rotor_inertia: self.rotor_inertia.clone(),
            mass: self.mass.clone(),
            inertia: self.inertia.iter().map(|(link, numbers)| (link.clone(), numbers.0)).collect(),
            ..LoadOptions::default()
        };
        Ok((folder.join(&self.urdf), options))
    }
}

/// So many numbers: arrays would be read from longer lists, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Numbers<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}

impl<const N: usize> std::ops::Deref for Numbers<N> {
    type Target = [f64; N];

    fn deref(&self) -> &[f64; N] {
        &self.0
    }
}

impl From<Numbers<3>> for nalgebra::Vector3<f64> {
    fn from(numbers: Numbers<3>) -> Self {
        numbers.0.into()
    }
}

impl<'de, const N: usize> serde::Deserialize<'de> for Numbers<N> {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let found = Vec::deserialize(from)?;
        let refuse = |found: Vec<f64>| serde::de::Error::custom(format!("{} numbers, {N} are needed", found.len()));
        found.try_into().map(Self).map_err(refuse)
    }
}
