//! Classes of device: how many corners are kept, and what that costs in bytes.

/// A class of device, and with it the size of a stored view and of a query.
///
/// A table holds views of one profile only: the probability of a false answer is calibrated for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Profile {
    /// Handheld navigation devices and microcontrollers: 100 corners a stored view, at most 2 KB.
    Handheld,
    /// Raspberry-class boards and PCs: 400 corners a stored view, at most 16 KB.
    Board,
}

impl Profile {
    /// Every profile, in the order of their codes.
    pub const ALL: [Self; 2] = [Self::Handheld, Self::Board];

    /// Corners that enrollment keeps for a view, at most.
    pub const fn corners_per_view(self) -> usize {
        match self {
            Self::Handheld => 100,
            Self::Board => 400,
        }
    }

    /// The largest size of a stored view, in bytes.
    pub const fn view_bytes(self) -> usize {
        match self {
            Self::Handheld => 2_048,
            Self::Board => 16_384,
        }
    }

    /// The byte that names this profile in a table.
    pub const fn code(self) -> u8 {
        match self {
            Self::Handheld => 1,
            Self::Board => 2,
        }
    }

    /// The profile that `code` names, if any.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            1 => Some(Self::Handheld),
            2 => Some(Self::Board),
            _ => None,
        }
    }

    /// The name as it is written on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Handheld => "handheld",
            Self::Board => "board",
        }
    }
}
