//! Mitsuba scenes.

mod attributes;
mod bad; // what is broken, unsupported or too large, and what is only warned of
mod files; // includes, parameters, search paths, volumes, and errors and warnings together
mod lights; // lights and surroundings
mod materials; // surfaces and textures
mod relief; // bump and normal maps
mod roughness; // roughness by map and direction, and transmission
mod setup; // camera, image size, path length; parameters and references
mod shapes; // shapes and their fronts
mod shared; // the scenes in `../shared`, where they are
