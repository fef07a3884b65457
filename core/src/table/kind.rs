//! What sort of thing a landmark is.

use core::fmt;

/// What sort of thing a landmark is; narrows a search and is shown to people.
///
/// The codes are part of the format: a new kind is a new format version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
#[non_exhaustive]
pub enum Kind {
    /// None of the others.
    #[default]
    Other,
    /// A building that none of the narrower kinds fits.
    Building,
    /// A dwelling.
    House,
    /// A church, or another house of worship.
    Church,
    /// A tower that stands for itself: gate, water, television.
    Tower,
    /// A castle, palace or fortress.
    Castle,
    /// A bridge.
    Bridge,
    /// A monument or statue.
    Monument,
    /// A lighthouse.
    Lighthouse,
}

impl Kind {
    /// Every kind, in the order of the codes.
    pub const ALL: [Self; 9] = [
        Self::Other,
        Self::Building,
        Self::House,
        Self::Church,
        Self::Tower,
        Self::Castle,
        Self::Bridge,
        Self::Monument,
        Self::Lighthouse,
    ];

    /// The byte that names this kind in a table.
    pub const fn code(self) -> u8 {
        match self {
            Self::Other => 0,
            Self::Building => 1,
            Self::House => 2,
            Self::Church => 3,
            Self::Tower => 4,
            Self::Castle => 5,
            Self::Bridge => 6,
            Self::Monument => 7,
            Self::Lighthouse => 8,
        }
    }

    /// The kind that `code` names, if any.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }

    /// The name as it is written on a command line and in a report.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Other => "other",
            Self::Building => "building",
            Self::House => "house",
            Self::Church => "church",
            Self::Tower => "tower",
            Self::Castle => "castle",
            Self::Bridge => "bridge",
            Self::Monument => "monument",
            Self::Lighthouse => "lighthouse",
        }
    }

    /// The kind that `name` names, if any; lower case, as [`Kind::name`] gives it.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}
