//! One page with all of it, that opens without a server and can be sent by mail: pictures and plots are in
//! it.

use super::denoising::{AfterDenoising, DENOISED_LIMIT};
use super::outcome::{Comparison, CriterionRun, families};
use super::pictures::{Pictures, WORST_FLIP};
use super::plots::{Cost, short};
use crate::error::LabError;
use base64::Engine;
use noisefloor_image::maps::Canvas;

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

/// One HTML page about all comparisons, with a [`section`] for each. If there are fewer than `scenes`, it says
/// that it is not finished.
pub fn page(all: &[Comparison], sections: &[String], scenes: usize) -> String {
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>Stopping criteria compared</title><style>{STYLE}</style></head><body>\n<h1>Stopping criteria compared</h1>\n\
         <p class=\"note\">noisefloor {}. On each scene all criteria watched one run: each took the samples of a tile until it stopped it. \
         <b>Uniform / this</b> is what uniform sampling takes until its worst tile is as good as the worst one here, over what this \
         criterion took: above 1 it saves. JOD is ColorVideoVDP's quality: 10 is no visible difference. \
         Source seconds are samples times what a sample of the tile cost in that run.</p>\n",
        env!("CARGO_PKG_VERSION")
    );
    if all.len() < scenes {
        let done = all.len();
        html +=
            &format!("<p><b>Not finished:</b> {done} of {scenes} scenes have been compared so far.</p>\n");
    }
    if all.len() > 1 {
        html += &summary(all);
    }
    sections.iter().for_each(|section| html.push_str(section));
    html.push_str("</body></html>\n");
    html
}

/// Ratio at equal worst tile, a line a family, a column a scene.
fn summary(all: &[Comparison]) -> String {
    let mut html = "<h2>All scenes</h2>\n<p>Uniform / this, at equal worst tile by FLIP (by butteraugli, by ColorVideoVDP):</p>\n<div class=\"wide\"><table>\
                    <thead><tr><th>criterion</th>"
        .to_owned();
    for comparison in all {
        html += &format!("<th>{}</th>", escape(&comparison.scene));
    }
    html.push_str("</tr></thead><tbody>\n");
    let first = all.first().map(|c| c.runs.as_slice()).unwrap_or_default();
    for family in families(first) {
        html += &format!("<tr{}><td>{}</td>", mark(family), escape(family));
        for comparison in all {
            let run = comparison.runs.iter().find(|run| run.taken.family == family);
            let flip = ratio(run.and_then(|run| run.against.uniform_over_this));
            let butteraugli = ratio(run.and_then(|run| run.against.uniform_over_this_butteraugli));
            let jod = ratio(run.and_then(|run| run.against.uniform_over_this_cvvdp));
            html += &format!("<td>{flip} ({butteraugli}, {jod})</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

/// All about one scene, as HTML. `plots` are drawn with a [`Cost`] each.
pub fn section(
    comparison: &Comparison,
    pictures: &Pictures,
    plots: &[(Cost, String)],
) -> Result<String, LabError> {
    let mut html = table(comparison);
    html += &denoised_table(comparison);
    for (cost, plot) in plots {
        let caption = match cost {
            Cost::Samples => "Error against samples per pixel; each sign is where a criterion stopped.",
            Cost::Seconds => "Error against seconds, of the source and the criterion together.",
        };
        html += &format!("<figure>{plot}<figcaption>{caption}</figcaption></figure>\n");
    }
    for crop in &pictures.crops {
        let (image, caption) = (data_uri(&crop.sheet)?, escape(&crop.caption));
        html += &format!(
            "<figure><div class=\"wide\"><img src=\"{image}\" alt=\"{caption}\"></div><figcaption>{caption} Below: FLIP error, black \
                 to yellow for 0 to {WORST_FLIP}.</figcaption></figure>\n"
        );
    }
    html.push_str("<div class=\"pictures\">\n");
    html.push_str(&figure(&pictures.reference, "reference")?);
    for family in families(&comparison.runs) {
        let Some(run) = comparison.runs.iter().find(|run| run.taken.family == family) else { continue };
        let Some((_, canvas)) = pictures.criteria.iter().find(|(spec, _)| *spec == run.taken.criterion)
        else {
            continue;
        };
        html += &figure(canvas, &format!("{}: {:.0} spp", run.taken.criterion, run.taken.spp_mean))?;
    }
    html.push_str("</div>\n");
    Ok(html)
}

/// Heading and table of one scene.
fn table(comparison: &Comparison) -> String {
    let (width, height) = comparison.size;
    let broken_off = if comparison.cancelled {
        "<p><b>This run was cancelled:</b> no criterion had more samples than those spent until then.</p>\n"
    } else {
        ""
    };
    let mut html = format!(
        "<h2>{}</h2>\n<p class=\"note\">{}, {width}×{height} pixels, against {}.</p>\n{broken_off}<div class=\"wide\"><table><thead><tr>\
         <th>criterion</th><th>spp, mean</th><th>most</th><th>tiles satisfied</th><th>source, s</th><th>criterion, s</th><th>relMSE</th>\
         <th>PSNR, dB</th><th>FLIP</th><th>worst tile</th><th>JOD</th><th>worst tile</th><th>butter&shy;augli</th><th>worst tile</th>\
         <th>uniform / this</th></tr></thead>\
         <tbody>\n",
        escape(&comparison.scene),
        escape(&comparison.source),
        escape(&comparison.reference),
    );
    comparison.runs.iter().for_each(|run| html.push_str(&row(run)));
    html.push_str("</tbody></table></div>\n");
    html
}

/// The same once the pictures are denoised; nothing where they are not.
fn denoised_table(comparison: &Comparison) -> String {
    let mut html = format!(
        "<p>Denoised (without albedo and normals), and within {DENOISED_LIMIT} JOD of the converged picture in every tile? Seconds are those \
         of source, criterion and denoiser. Uniform sampling gets there at {} spp. Nobody has been asked about denoised pictures: \
         the JODs are the vision model's.</p>\n<div class=\"wide\"><table><thead><tr><th>criterion</th><th>spp, mean</th><th>seconds</th>\
         <th>JOD</th><th>worst tile</th><th>within</th></tr></thead><tbody>\n",
        comparison
            .uniform_denoised()
            .map_or_else(|| "no measured number of".to_owned(), |spp| format!("{spp:.0}"))
    );
    for CriterionRun { taken, denoised, .. } in &comparison.runs {
        let Some(AfterDenoising { seconds, jod, jod_worst: worst }) = *denoised else { return String::new() };
        let within = if 10.0 - worst <= DENOISED_LIMIT { "yes" } else { "no" };
        let (criterion, spp) = (escape(&taken.criterion), taken.spp_mean);
        let seconds = short(taken.seconds() + seconds);
        html += &format!(
            "<tr{}><td>{criterion}</td><td>{spp:.0}</td><td>{seconds}</td><td>{jod:.3}</td><td>{worst:.3}</td><td>{within}</td></tr>\n",
            mark(&taken.family)
        );
    }
    html + "</tbody></table></div>\n"
}

fn row(CriterionRun { taken, quality, against, .. }: &CriterionRun) -> String {
    let cells = [
        format!("{:.0}", taken.spp_mean),
        taken.spp_most.to_string(),
        format!("{} of {}", taken.tiles_converged, taken.tiles),
        short(taken.source_seconds),
        short(taken.criterion_seconds),
        short(quality.rel_mse),
        format!("{:.1}", quality.psnr),
        short(quality.flip),
        short(quality.flip_worst),
        format!("{:.3}", quality.cvvdp_jod),
        format!("{:.3}", quality.cvvdp_jod_worst),
        short(quality.butteraugli),
        short(quality.butteraugli_worst),
        ratio(against.uniform_over_this),
    ];
    let cells = cells.map(|cell| format!("<td>{cell}</td>")).concat();
    let (name, criterion) = (escape(&taken.name), escape(&taken.criterion));
    format!("<tr{}><td title=\"{name}\">{criterion}</td>{cells}</tr>\n", mark(&taken.family))
}

fn figure(canvas: &Canvas, caption: &str) -> Result<String, LabError> {
    let (image, caption) = (data_uri(canvas)?, escape(caption));
    Ok(format!(
        "<figure><img src=\"{image}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>\n"
    ))
}

fn mark(family: &str) -> &'static str {
    if family == "oracle" { " class=\"oracle\"" } else { "" }
}

fn ratio(ratio: Option<f64>) -> String {
    ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}"))
}

fn data_uri(canvas: &Canvas) -> Result<String, LabError> {
    let bytes = canvas.to_png().map_err(|error| LabError::Plot(error.to_string()))?;
    Ok(format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes)))
}

/// Text that may come from a file name, as HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
