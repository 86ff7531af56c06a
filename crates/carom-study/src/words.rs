//! Enums whose values are words.

/// Gives enums the list of their values and the names, by which serde writes them.
#[doc(hidden)] // for carom-evidence
#[macro_export]
macro_rules! words {
    ($($kind:ident { $($variant:ident $name:literal),+ })+) => {$(
        #[allow(dead_code)] // a kind of one crate does not need both
        impl $kind {
            /// All of them.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            #[doc = concat!("The name:", $(" `", $name, "`",)+ ".")]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }

        impl serde::Serialize for $kind {
            fn serialize<S: serde::Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
                out.serialize_str(self.name())
            }
        }
    )+};
}
