//! One page with figures and tables, and tables written between the marks of a hand-written text.

use crate::figure::Figure;
use crate::table::{Table, escaped};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// A part of a report.
#[derive(Debug)]
pub struct Section {
    /// Name of its CSV file and of its marks in a text.
    pub name: &'static str,
    /// What it is about.
    pub title: String,
    /// What was measured, in words.
    pub text: String,
    /// Its figures, named after it.
    pub figures: Vec<Figure>,
    /// All its numbers.
    pub table: Table,
    /// Those that a text shows.
    pub summary: Table,
}

/// A page that needs nothing but itself: figures with tool tips, a table below each, light and dark.
pub fn html(title: &str, text: &str, sections: &[Section]) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <style>{STYLE}</style></head>\n<body><main>\n<h1>{0}</h1>\n<p>{1}</p>\n<nav>",
        escaped(title),
        escaped(text)
    );
    for s in sections {
        let _ = writeln!(out, "<a href=\"#{}\">{}</a>", s.name, escaped(&s.title));
    }
    out.push_str("</nav>\n");
    for s in sections {
        let _ =
            writeln!(out, "<section id=\"{}\">\n<h2>{}</h2>\n<p>{}</p>", s.name, escaped(&s.title), escaped(&s.text));
        for f in &s.figures {
            let _ = writeln!(out, "<figure>{}<figcaption>{}</figcaption></figure>", f.inline(), escaped(&f.caption));
        }
        let _ = writeln!(out, "<div class=\"table\">{}</div>", s.summary.html());
        let _ = writeln!(
            out,
            "<details><summary>All numbers ({} rows; {}.csv)</summary><div class=\"table all\">{}</div></details>\n</section>",
            s.table.rows().len(),
            s.name,
            s.table.html()
        );
    }
    out + "</main><div id=\"tip\" hidden></div>\n<script>" + SCRIPT + "</script></body></html>\n"
}

const STYLE: &str = ":root{color-scheme:light dark;--paper:#ffffff;--ink:#1f2933;--rule:#7b8794;--soft:#f2f4f7;--link:#0b5cad}\
@media (prefers-color-scheme:dark){:root{--paper:#14181d;--ink:#e4e8ee;--rule:#8a95a3;--soft:#20262e;--link:#7db9f5}}\
body{background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,sans-serif;margin:0}\
main{max-width:1240px;margin:0 auto;padding:1rem 1.25rem 4rem}h1{font-size:1.7rem}h2{margin-top:3rem;border-top:1px solid var(--rule);padding-top:1rem}\
p,figcaption{max-width:62rem}a{color:var(--link)}nav{display:flex;flex-wrap:wrap;gap:.4rem 1.2rem}\
figure{margin:1.5rem 0}figure svg{max-width:100%;height:auto;display:block}figcaption{margin-top:.5rem;font-weight:500}\
.table{overflow:auto;margin:1rem 0}.all{max-height:32rem}table{border-collapse:collapse;font-size:.85rem;font-variant-numeric:tabular-nums}\
th{position:sticky;top:0;background:var(--soft);text-align:right}th,td{padding:.2rem .6rem;border-bottom:1px solid var(--soft);white-space:nowrap}\
td{text-align:right}td.word,th:first-child{text-align:left}summary{cursor:pointer;color:var(--link)}\
.hit{fill:transparent}.hit:hover{stroke:var(--ink);stroke-width:2}\
#tip{position:fixed;background:var(--ink);color:var(--paper);padding:.3rem .6rem;border-radius:.3rem;font-size:.85rem;white-space:pre-line;pointer-events:none;max-width:26rem}";

/// The tool tip follows the pointer; without scripts a point's own title stands in.
const SCRIPT: &str = "const t=document.getElementById('tip');for(const c of document.querySelectorAll('.hit')){\
const n=c.querySelector('title');c.addEventListener('pointerenter',()=>{if(n)n.remove();t.textContent=c.dataset.tip;t.hidden=false});\
c.addEventListener('pointermove',e=>{t.style.left=Math.min(e.clientX+14,innerWidth-t.offsetWidth-8)+'px';t.style.top=(e.clientY+16)+'px'});\
c.addEventListener('pointerleave',()=>{t.hidden=true})}";

/// By which command a report was made, and of what build.
pub fn made_by(bin: &str, quick: bool) -> String {
    let build = if cfg!(debug_assertions) {
        "debug assertions on: times are not those of a release build"
    } else {
        "release build"
    };
    let quick = if quick { " -- --quick" } else { "" };
    format!("Made by cargo run --release -p contactd-benches --bin {bin}{quick} ({build}).")
}

/// Where a report goes.
#[derive(Debug)]
pub struct Place<'a> {
    /// The folder of its page, with each figure as SVG and PNG and each table as CSV.
    pub page: &'a Path,
    /// A text with the summaries between its marks, and the folder beside it of the tables' CSV and of the figures that it shows.
    pub words: Option<(&'a Path, &'a Path)>,
}

/// Prints the tables of sections and writes the report; nothing but what a text shows, and CSV, is written beside that text.
///
/// # Errors
/// A folder or the text cannot be written, or a mark is not there.
pub fn publish((title, text): (&str, &str), sections: &[Section], place: &Place<'_>) -> Result<(), Box<dyn Error>> {
    for section in sections {
        print!("{}", section.table.text());
        section.table.write(section.name, place.page)?;
        for figure in &section.figures {
            figure.write(place.page)?;
        }
    }
    let page = place.page.join("index.html");
    std::fs::write(&page, html(title, text, sections))?;
    println!("written: {}", page.display());
    if let Some((path, folder)) = place.words {
        let mut words = std::fs::read_to_string(path)?;
        for section in sections {
            words = between_marks(&words, section.name, &section.summary.markdown())?;
            section.table.write(section.name, folder)?;
            for figure in section.figures.iter().filter(|f| words.contains(&format!("/{}.png)", f.name))) {
                figure.write_png(folder)?;
            }
        }
        std::fs::write(path, words)?;
        println!("written: {}", path.display());
    }
    Ok(())
}

/// A text with what stands between the marks `<!-- NAME -->` and `<!-- /NAME -->` replaced.
///
/// # Errors
/// The marks are not there, or in the wrong order.
pub fn between_marks(text: &str, name: &str, body: &str) -> Result<String, String> {
    let marks = [format!("<!-- {name} -->"), format!("<!-- /{name} -->")];
    let [from, to] = marks.each_ref().map(|m| text.find(m.as_str()));
    match (from, to) {
        (Some(from), Some(to)) if from < to => {
            Ok(format!("{}{}\n\n{}\n{}", &text[..from], marks[0], body.trim_end().to_owned() + "\n", &text[to..]))
        }
        _ => Err(format!("expected the marks {} and {}", marks[0], marks[1])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Axis, Series, Stroke};
    use crate::row;

    #[test]
    fn a_table_goes_between_its_marks_and_the_rest_stays() {
        let text = "before\n<!-- a -->\nold\n<!-- /a -->\nafter";
        let once = between_marks(text, "a", "new\n").expect("marks");
        assert_eq!(once, "before\n<!-- a -->\n\nnew\n\n<!-- /a -->\nafter");
        assert_eq!(between_marks(&once, "a", "new").expect("marks"), once);
        assert!(between_marks(text, "b", "new").is_err());
    }

    #[test]
    fn beside_a_text_stand_numbers_and_the_figures_that_it_shows() {
        let figure = |name: &str| Figure {
            name: name.into(),
            title: "t".into(),
            caption: "c".into(),
            axes: [Axis::Linear("x".into()), Axis::Linear("y".into())],
            series: vec![Series { name: "s".into(), points: vec![[1.0, 2.0]], stroke: Stroke::Solid, color: 0 }],
        };
        let mut table = Table::new(&["class", "us"]);
        table.push(row!["peg", 1.5]);
        let figures = vec![figure("s_shown"), figure("s_hidden")];
        let (title, text, summary) = ("A".into(), "words".into(), table.clone());
        let section = Section { name: "s", title, text, figures, table, summary };
        let folder = std::env::temp_dir().join(format!("contactd_page_{}", std::process::id()));
        let (page, beside, words) = (folder.join("page"), folder.join("text"), folder.join("text.md"));
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        std::fs::write(&words, "![t](text/s_shown.png)\n<!-- s -->\n<!-- /s -->\n").expect("a text");
        let place = Place { page: &page, words: Some((&words, &beside)) };
        publish(("title", "text"), &[section], &place).expect("published");
        let names = |folder: &Path| {
            let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").file_name());
            let mut names: Vec<String> = entries.map(|n| n.to_string_lossy().into_owned()).collect();
            names.sort();
            names
        };
        assert_eq!(names(&beside), ["s.csv", "s_shown.png"]);
        let all = ["index.html", "s.csv", "s_hidden.png", "s_hidden.svg", "s_shown.png", "s_shown.svg"];
        assert_eq!(names(&page), all);
        assert!(std::fs::read_to_string(&words).expect("the text").contains("| peg | 1.50 |"));
        std::fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn a_page_needs_nothing_but_itself() {
        let table = || {
            let mut t = Table::new(&["class", "us"]);
            t.push(row!["<peg>", 1.5]);
            t
        };
        let section = Section {
            name: "s",
            title: "A & B".into(),
            text: "words".into(),
            figures: vec![],
            table: table(),
            summary: table(),
        };
        let page = html("Title", "text", &[section]);
        assert!(page.contains("A &amp; B") && page.contains("&lt;peg&gt;") && page.contains("prefers-color-scheme"));
        assert!(!page.contains("http") && !page.contains("src="), "nothing is fetched");
    }
}
