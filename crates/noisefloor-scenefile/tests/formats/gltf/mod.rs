//! glTF files.

mod bad; // bad files, and what is said of them
mod draco; // compressed meshes
mod extensions; // normal maps, coats, colours of vertices, daylight
mod geometry; // where triangles and cameras are
pub(crate) mod kit;
mod lights; // lights without size
mod materials; // what surfaces look like
