//! Numbers as people say them.

/// A probability as a person reads it: percent down to one in a thousand, then "1 in n", and below one in a million no
/// more than that, because nothing that far out was ever measured.
pub fn probability(p: f64) -> String {
    if p >= 0.9995 {
        "100 %".to_owned()
    } else if p >= 0.095 {
        format!("{:.0} %", p * 100.0)
    } else if p >= 0.000_95 {
        format!("{} %", format!("{:.2}", p * 100.0).trim_end_matches('0').trim_end_matches('.'))
    } else if p >= 1e-6 {
        format!("1 in {}", grouped(two_digits(1.0 / p)))
    } else {
        "less than 1 in 1,000,000".to_owned()
    }
}

/// Bits with one decimal and a sign.
pub fn signed_bits(bits: f64) -> String {
    format!("{bits:+.1} bits")
}

/// 1234567 as 1,234,567.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// "1 view", "2 views".
pub fn count(number: usize, thing: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{} {thing}{plural}", grouped(number as u64))
}

/// Milliseconds with three digits.
pub fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms >= 99.95 => format!("{ms:.0} ms"),
        ms if ms >= 9.995 => format!("{ms:.1} ms"),
        ms if ms >= 0.1 => format!("{ms:.2} ms"),
        ms => format!("{:.1} µs", ms * 1_000.0),
    }
}

/// Text that is fit for one line and for XML: control characters, which a file name may hold, become U+FFFD.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

fn two_digits(value: f64) -> u64 {
    let mut unit = 1.0;
    while value / unit >= 100.0 {
        unit *= 10.0;
    }
    ((value / unit).round() * unit) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_read_well() {
        let cases = [
            (1.0, "100 %"),
            (0.5, "50 %"),
            (0.1, "10 %"),
            (0.031_4, "3.14 %"),
            (0.03, "3 %"),
            (0.01, "1 %"),
            (0.001, "0.1 %"),
            (0.000_123, "1 in 8,100"),
            (1e-9, "less than 1 in 1,000,000"),
            (0.0, "less than 1 in 1,000,000"),
        ];
        for (p, text) in cases {
            assert_eq!(probability(p), text);
        }
    }

    #[test]
    fn thousands_are_grouped() {
        assert_eq!([0, 999, 1_000, 12_345_678].map(grouped), ["0", "999", "1,000", "12,345,678"]);
        assert_eq!([count(1, "view"), count(2_000, "view")], ["1 view", "2,000 views"]);
    }

    #[test]
    fn nothing_unprintable_remains() {
        assert_eq!(printable("a\nb\u{1b}[31m"), "a\u{fffd}b\u{fffd}[31m");
    }
}
