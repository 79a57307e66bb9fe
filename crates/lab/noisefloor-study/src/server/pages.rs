//! The pages, embedded in the program.

use noisefloor_pages::http::{ASK, HTML, LOOK, PICTURE, PageFile, SCRIPT, SHEET, STYLE, VIEWING};

macro_rules! page {
    ($name:literal, $kind:expr) => {
        ($name, $kind, include_str!(concat!("../../pages/", $name)))
    };
}

pub(super) const PAGE: &str = include_str!("../../pages/index.html");
pub(super) const FILES: [PageFile; 12] = [
    page!("app.js", SCRIPT),
    ASK,
    page!("experimenter.css", STYLE),
    page!("experimenter.html", HTML),
    page!("experimenter.js", SCRIPT),
    PICTURE,
    page!("server.js", SCRIPT),
    SHEET,
    page!("trials.js", SCRIPT),
    VIEWING,
    page!("welcome.js", SCRIPT),
    LOOK,
];
