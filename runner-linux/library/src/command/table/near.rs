//! Names that somebody may have meant.

use crate::order;
use crate::report::phrase::printable;

/// Names that are told, at most.
const TOLD: usize = 3;

/// A question that suggests names near to `wanted`; empty if none is near.
pub(super) fn suggestion<'a>(wanted: &str, names: impl Iterator<Item = &'a str>) -> String {
    let wanted = wanted.to_lowercase();
    let most = 1 + wanted.chars().count() / 4;
    let mut near: Vec<(usize, &str)> = names
        .filter_map(|name| {
            let other = name.to_lowercase();
            let part = !wanted.is_empty() && (other.contains(&wanted) || wanted.contains(&other));
            let distance = if part { 0 } else { distance(&wanted, &other) };
            (distance <= most).then_some((distance, name))
        })
        .collect();
    order::sort(&mut near);
    if near.is_empty() {
        return String::new();
    }
    let names: Vec<String> = near.into_iter().take(TOLD).map(|(_, name)| format!("{:?}", printable(name))).collect();
    format!("did you mean {}? ", names.join(" or "))
}

/// Levenshtein's distance: characters to insert, delete or replace.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_counts_edits() {
        let cases = [("", "", 0), ("", "ab", 2), ("kitten", "sitting", 3), ("tower", "twoer", 2), ("gate", "gate", 0)];
        for (a, b, expected) in cases {
            assert_eq!((distance(a, b), distance(b, a)), (expected, expected), "{a} {b}");
        }
    }

    #[test]
    fn near_names_are_suggested_the_nearest_first() {
        let names = ["Old gate", "Old mill", "Town hall", "Water tower"];
        let said = |wanted| suggestion(wanted, names.into_iter());
        assert_eq!(said("old gat"), "did you mean \"Old gate\"? ");
        assert_eq!(said("Old nill"), "did you mean \"Old mill\"? ");
        assert_eq!(said("old"), "did you mean \"Old gate\" or \"Old mill\"? ");
        assert_eq!(said("bridge"), "");
    }
}
