//! Pages (HTML) that need nothing beside them.

use std::fmt::Write as _;

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#18202c;--pale:#5d6b80;--ground:#fbfbf9;--card:#fff;--line:#e2e5ea;--good:#0f8a55;--bad:#c8372d;--mark:#b7791f}
@media(prefers-color-scheme:dark){:root{--ink:#e8edf5;--pale:#9fb0c8;--ground:#0e1420;--card:#182131;--line:#2a364a;--good:#4ade9b;--bad:#ff8070;--mark:#ffd34d}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2.5rem 1.5rem 4rem;max-width:76rem;background:var(--ground);color:var(--ink);font:16px/1.55 system-ui,'Segoe UI','Helvetica Neue','DejaVu Sans',sans-serif}
h1{font-size:1.9rem;letter-spacing:-.02em;margin:0 0 .3rem}
h2{font-size:1.25rem;margin:2.6rem 0 .6rem}
p{max-width:46rem}
.pale{color:var(--pale)}
.tiles{display:flex;flex-wrap:wrap;gap:.8rem;margin:1.4rem 0}
.tile{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:.8rem 1.1rem;min-width:9.5rem}
.tile b{display:block;font-size:1.6rem;font-variant-numeric:tabular-nums;letter-spacing:-.02em}
.tile span{color:var(--pale);font-size:.85rem}
.row{display:flex;flex-wrap:wrap;gap:1.2rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.32rem .8rem;text-align:right;border-bottom:1px solid var(--line)}
th{font-weight:600;color:var(--pale)}
th:first-child,td:first-child{text-align:left;padding-left:0}
.scroll{overflow-x:auto;margin:1rem 0}
figure{margin:0}
figcaption{font-size:.82rem;color:var(--pale);margin-top:.3rem;overflow-wrap:anywhere}
.card{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:1rem;margin:.9rem 0}
.card h3{margin:0 0 .6rem;font-size:1rem}
.trio{display:grid;grid-template-columns:repeat(auto-fit,minmax(15rem,1fr));gap:.9rem}
.trio svg,.trio img{width:100%;height:auto;display:block;border-radius:6px}
.wide svg,.wide img{width:100%;height:auto;display:block;border-radius:8px}
.good{color:var(--good)}.bad{color:var(--bad)}.mark{color:var(--mark)}
summary{cursor:pointer;font-weight:600}
code{font-size:.9em}
a{color:inherit}
";

/// A page with this title and this body, which is HTML already.
pub fn page(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escape(title)
    )
}

/// Text as HTML, in an element or a quoted attribute.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in super::phrase::printable(text).chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// Several lines of text as HTML: [`escape`] that keeps line ends.
pub fn escape_lines(text: &str) -> String {
    text.lines().map(escape).collect::<Vec<_>>().join("\n")
}

/// A number to remember and what it is.
pub fn tile(value: &str, what: &str) -> String {
    format!("<div class=\"tile\"><b>{}</b><span>{}</span></div>\n", escape(value), escape(what))
}

/// A table; the first column is text, the others are numbers.
pub fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let mut html = "<div class=\"scroll\"><table>\n<tr>".to_owned();
    for head in heads {
        // Writing to a string cannot fail.
        let _ = write!(html, "<th>{}</th>", escape(head));
    }
    html.push_str("</tr>\n");
    for row in rows {
        html.push_str("<tr>");
        for cell in row {
            let _ = write!(html, "<td>{}</td>", escape(cell));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n");
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_people_write_cannot_become_markup() {
        assert_eq!(escape("<b a='1'>\"&\n"), "&lt;b a=&#39;1&#39;&gt;&quot;&amp;\u{fffd}");
        assert!(page("a<b", "").contains("<title>a&lt;b</title>"));
    }
}
