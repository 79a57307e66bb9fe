//! One page with all of it, that opens without a server and can be sent by mail: pictures and plots are in it.

use super::crops::WORST_FLIP;
use super::plots::short;
use super::{Compared, Run, families};
use anyhow::Context;
use base64::Engine;
use noisefloor_image::write_atomic;
use std::fmt::Write;
use std::path::Path;

const STYLE: &str = "
  :root { color-scheme: light; }
  body { font: 15px/1.5 system-ui, sans-serif; color: #1b1b1b; background: #fff; margin: 2rem auto; max-width: 1120px; padding: 0 1rem; }
  h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-bottom: 1px solid #ddd; }
  p, figcaption { max-width: 46rem; } figcaption, .note { color: #555; font-size: .9rem; }
  table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
  th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid #e4e4e4; white-space: nowrap; }
  th:first-child, td:first-child { text-align: left; } thead th { border-bottom: 2px solid #999; vertical-align: bottom; white-space: normal; }
  tr.oracle { background: #eef5fb; } .wide { overflow-x: auto; } figure { margin: 1rem 0; } img, svg { max-width: 100%; height: auto; }
  .pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(200px, 1fr)); gap: .8rem; }
  .pictures figure { margin: 0; } .pictures img { width: 100%; }
";

/// Writes index.html.
pub fn write(out: &Path, all: &[Compared]) -> anyhow::Result<()> {
    let mut html = String::new();
    page(&mut html, all)?;
    write_atomic(out.join("index.html"), |to| std::io::Write::write_all(to, html.as_bytes()))?;
    Ok(())
}

fn page(html: &mut String, all: &[Compared]) -> anyhow::Result<()> {
    writeln!(
        html,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>Stopping criteria compared</title><style>{STYLE}</style></head><body>\n<h1>Stopping criteria compared</h1>\n\
         <p class=\"note\">noisefloor {}. On each scene all criteria watched one run: each took the samples of a tile until it stopped it. \
         <b>Uniform / this</b> is what uniform sampling takes until its worst tile is as good as the worst one here, over what this \
         criterion took: above 1 it saves. Source seconds are samples times what a sample of the tile cost in that run.</p>",
        env!("CARGO_PKG_VERSION")
    )?;
    if all.len() > 1 {
        html.push_str("<h2>All scenes</h2>\n");
        summary(html, all)?;
    }
    for compared in all {
        scene(html, compared)?;
    }
    html.push_str("</body></html>\n");
    Ok(())
}

/// Ratio at equal worst tile, a line a family, a column a scene.
fn summary(html: &mut String, all: &[Compared]) -> anyhow::Result<()> {
    html.push_str("<p>Uniform / this, at equal worst tile by FLIP (by butteraugli):</p>\n<div class=\"wide\"><table><thead><tr><th>criterion</th>");
    for compared in all {
        write!(html, "<th>{}</th>", escape(&compared.scene))?;
    }
    html.push_str("</tr></thead><tbody>\n");
    let first = all.first().map(|c| c.runs.as_slice()).unwrap_or_default();
    for family in families(first) {
        write!(html, "<tr{}><td>{}</td>", mark(family), escape(family))?;
        for compared in all {
            let run = compared.runs.iter().find(|run| run.family == family);
            write!(
                html,
                "<td>{} ({})</td>",
                ratio(run.and_then(|run| run.uniform_over_this)),
                ratio(run.and_then(|run| run.uniform_over_this_butteraugli))
            )?;
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    Ok(())
}

fn scene(html: &mut String, compared: &Compared) -> anyhow::Result<()> {
    let (width, height) = compared.size;
    writeln!(
        html,
        "<h2>{}</h2>\n<p class=\"note\">{}, {width}×{height} pixels, against {}.</p>\n<div class=\"wide\"><table><thead><tr><th>criterion</th>\
         <th>spp, mean</th><th>most</th><th>tiles satisfied</th><th>source, s</th><th>criterion, s</th><th>relMSE</th><th>PSNR, dB</th>\
         <th>FLIP</th><th>worst tile</th><th>butter&shy;augli</th><th>worst tile</th><th>uniform / this</th></tr></thead><tbody>",
        escape(&compared.scene),
        escape(&compared.source),
        escape(&compared.reference),
    )?;
    for run in &compared.runs {
        row(html, run)?;
    }
    html.push_str("</tbody></table></div>\n");
    for (name, caption) in [
        ("by-samples", "Error against samples per pixel; each sign is where a criterion stopped."),
        ("by-seconds", "Error against seconds, of the source and the criterion together."),
    ] {
        let path = compared.folder.join(name).with_extension("svg");
        let svg = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        writeln!(html, "<figure>{svg}<figcaption>{caption}</figcaption></figure>")?;
    }
    for (file, caption) in &compared.crops {
        let image = data_uri(&compared.folder.join(file))?;
        let caption = escape(caption);
        writeln!(
            html,
            "<figure><div class=\"wide\"><img src=\"{image}\" alt=\"{caption}\"></div><figcaption>{caption} Below: FLIP error, black to yellow \
             for 0 to {WORST_FLIP}.</figcaption></figure>"
        )?;
    }
    html.push_str("<div class=\"pictures\">\n");
    let picture = |html: &mut String, file: &str, caption: &str| -> anyhow::Result<()> {
        let image = data_uri(&compared.folder.join(file))?;
        let caption = escape(caption);
        writeln!(
            html,
            "<figure><img src=\"{image}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>"
        )?;
        Ok(())
    };
    picture(html, "reference.png", "reference")?;
    for family in families(&compared.runs) {
        let Some(run) = compared.runs.iter().find(|run| run.family == family) else { continue };
        let file = format!("{}.png", run.criterion.replace(':', "-"));
        picture(html, &file, &format!("{}: {:.0} spp", run.criterion, run.spp_mean))?;
    }
    html.push_str("</div>\n");
    Ok(())
}

fn row(html: &mut String, run: &Run) -> anyhow::Result<()> {
    writeln!(
        html,
        "<tr{}><td title=\"{}\">{}</td><td>{:.0}</td><td>{}</td><td>{} of {}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{}</td>\
         <td>{}</td><td>{}</td><td>{}</td></tr>",
        mark(&run.family),
        escape(&run.name),
        escape(&run.criterion),
        run.spp_mean,
        run.spp_most,
        run.tiles_converged,
        run.tiles,
        short(run.source_seconds),
        short(run.criterion_seconds),
        short(run.rel_mse),
        run.psnr,
        short(run.flip),
        short(run.flip_worst),
        short(run.butteraugli),
        short(run.butteraugli_worst),
        ratio(run.uniform_over_this),
    )?;
    Ok(())
}

fn mark(family: &str) -> &'static str {
    if family == "oracle" { " class=\"oracle\"" } else { "" }
}

fn ratio(ratio: Option<f64>) -> String {
    ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}"))
}

fn data_uri(path: &Path) -> anyhow::Result<String> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    Ok(format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes)))
}

/// Text that may come from a file name, as HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
