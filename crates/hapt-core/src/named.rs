//! Enums whose variants have names: one list of rows gives variants, names, and the conversion between them.

/// An enum without data, one row a variant: `Variant => "name"`, or `Variant = CODE => "name"` where a code is frozen.
///
/// It gets `ALL` and `NAMES`, in the order of the rows, `name` and `from_name`. No list of variants is written by hand, so that none is
/// incomplete.
///
/// ```
/// hapt_core::named! {
///     /// A colour.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub enum Colour {
///         /// Of tomatoes.
///         Red => "red",
///         /// Of grass.
///         Green => "green",
///     }
/// }
/// assert_eq!(Colour::from_name("green"), Some(Colour::Green));
/// assert_eq!(Colour::ALL.map(Colour::name), ["red", "green"]);
/// ```
#[macro_export]
macro_rules! named {
    ($(#[$about:meta])* pub enum $Kind:ident {
        $($(#[$doc:meta])* $Variant:ident $(= $code:literal)? => $name:literal,)*
    }) => {
        $(#[$about])*
        pub enum $Kind {
            $($(#[$doc])* $Variant $(= $code)?,)*
        }

        impl $Kind {
            /// All of them, in the order of the documentation.
            pub const ALL: [$Kind; $Kind::NAMES.len()] = [$($Kind::$Variant),*];
            /// Their names, in the same order.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// Its name in files, messages and logs.
            pub const fn name(self) -> &'static str {
                match self {
                    $($Kind::$Variant => $name,)*
                }
            }

            /// The variant with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.name() == name)
            }
        }
    };
}
