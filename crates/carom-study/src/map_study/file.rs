//! Deserialisation of a study file; the book documents the keys (`book/src/reference-study.md`).

use carom_sim::key_group;
use carom_sim::keys::{Loading, Table};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub robot: Table<(Loading, Robot)>,
    pub joints: Option<BTreeMap<String, Values>>,
    pub tip: Option<Tip>,
    pub impact: Impact,
    pub map: Map,
    pub advise: Option<Advise>,
}

key_group! {
    /// The keys of `[robot]` that scenes do not have.
    pub(super) struct Robot needs [] {
        point: [f64; 3],
        limits: bool = true,
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tip {
    pub x: Option<Values>,
    pub y: Option<Values>,
    pub z: Option<Values>,
    pub elbow: Option<Elbow>,
    pub seeds: Option<Vec<Vec<f64>>>,
    pub pointing: Option<Pointing>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pointing {
    pub axis: [f64; 3],
    pub direction: [f64; 3],
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Elbow {
    Both,
    Up,
    Down,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Impact {
    pub normal: Option<Normals>,
    pub normal_deg: Option<Values>,
    pub along: Option<[f64; 3]>,
    pub approach_deg: Values,
    pub speed: Values,
    pub law: Words,
    pub restitution: Values,
    #[serde(default = "zero")]
    pub friction: Values,
    pub tangential_restitution: Option<Values>,
    #[serde(default)]
    pub locked: Vec<String>,
    pub motion: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Map {
    pub quantities: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Advise {
    pub minimise: Option<String>,
    pub maximise: Option<String>,
    pub class: Option<Vec<String>>,
    #[serde(default)]
    pub at_most: BTreeMap<String, f64>,
    #[serde(default)]
    pub at_least: BTreeMap<String, f64>,
    #[serde(default = "five")]
    pub best: usize,
}

/// One direction or several.
pub(super) struct Normals(pub Vec<[f64; 3]>);

/// One word or several.
pub(super) struct Words(pub Vec<String>);

/// The values of one axis: a number, a list, or a range.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    One(f64),
    List(Vec<f64>),
    Range { from: f64, to: f64, count: u64, degrees: bool },
}

fn zero() -> Values {
    Values::One(0.0)
}
fn five() -> usize {
    5
}

/// The keys of a range.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Range {
    from: f64,
    to: f64,
    count: u64,
    #[serde(default)]
    unit: Unit,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Unit {
    #[default]
    Rad,
    Deg,
}

/// Keeps the messages about the keys of a range, which an untagged enum would lose.
impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = Values;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number, a list of numbers, or { from, to, count }")
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Values, E> {
                Ok(Values::One(x))
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Values, E> {
                Ok(Values::One(x as f64))
            }
            fn visit_u64<E: Error>(self, x: u64) -> Result<Values, E> {
                Ok(Values::One(x as f64))
            }
            fn visit_seq<S: SeqAccess<'de>>(self, seq: S) -> Result<Values, S::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Values::List)
            }
            fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<Values, M::Error> {
                let Range { from, to, count, unit } = Range::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Values::Range { from, to, count, degrees: unit == Unit::Deg })
            }
        }
        from.deserialize_any(Reader)
    }
}

impl<'de> Deserialize<'de> for Words {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = Words;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a name or a list of names")
            }
            fn visit_str<E: Error>(self, word: &str) -> Result<Words, E> {
                Ok(Words(vec![word.into()]))
            }
            fn visit_seq<S: SeqAccess<'de>>(self, mut seq: S) -> Result<Words, S::Error> {
                let mut words = Vec::new();
                while let Some(word) = seq.next_element()? {
                    words.push(word);
                }
                Ok(Words(words))
            }
        }
        from.deserialize_any(Reader)
    }
}

impl<'de> Deserialize<'de> for Normals {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;
        /// A coordinate of the one normal, or one of several normals.
        struct Item(Result<f64, [f64; 3]>);
        impl<'de> Deserialize<'de> for Item {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                Ok(match Values::deserialize(from)? {
                    Values::One(x) => Self(Ok(x)),
                    Values::List(list) => match <[f64; 3]>::try_from(list) {
                        Ok(normal) => Self(Err(normal)),
                        Err(list) => return Err(Error::invalid_length(list.len(), &"three numbers")),
                    },
                    Values::Range { .. } => return Err(Error::custom("a normal has three numbers, [x, y, z]")),
                })
            }
        }
        impl<'de> Visitor<'de> for Reader {
            type Value = Normals;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a normal [x, y, z], or a list of normals")
            }
            fn visit_seq<S: SeqAccess<'de>>(self, mut seq: S) -> Result<Normals, S::Error> {
                let (mut numbers, mut normals) = (Vec::new(), Vec::new());
                while let Some(Item(item)) = seq.next_element()? {
                    match item {
                        Ok(x) => numbers.push(x),
                        Err(normal) => normals.push(normal),
                    }
                }
                match (numbers.as_slice(), normals.is_empty()) {
                    (&[x, y, z], true) => Ok(Normals(vec![[x, y, z]])),
                    ([], false) => Ok(Normals(normals)),
                    _ => Err(Error::custom("expected a normal [x, y, z], or a list of normals")),
                }
            }
        }
        from.deserialize_any(Reader)
    }
}
