//! Shapes.

use super::params::Params;
use super::reader::Reader;
use super::state::{Form, Part, Wear};
use crate::error::{LoadError, Place};
use crate::files::{MAX_FILE_BYTES, has_memory};
use crate::mesh::{Triangles, ply, solids, subdivide};
use glam::{DMat3, DMat4, DVec3, Vec3};
use noisefloor_ptwne::Texture;
use std::f64::consts::PI;

/// Bytes that a triangle of a subdivision takes on the way.
const SUBDIVIDING: u64 = 400;

impl Reader<'_> {
    /// Adds a `Shape`, to the scene or to the object that is open.
    pub(super) fn shape(&mut self, kind: &str, params: &Params) -> Result<(), LoadError> {
        if self.state.in_medium {
            if !self.options.ignore_volumes {
                return Err(params.place.unsupported(crate::options::NO_MEDIA));
            }
            self.load.ignored(&params.place, "the participating medium is ignored");
        }
        self.load.bounds.spend(params.numbers_in_all(), &params.place)?;
        let alpha = self.alpha(params)?;
        let light = self.state.area_light.clone();
        let material = self.current_material(alpha, light.is_some(), &params.place)?;
        // Whole, and its light from its outside. Whether instances stretch it is seen when they come
        let in_object = self.open_object.is_some();
        let shines = light.as_ref().is_some_and(|light| !light.emission.two_sided);
        let pictured = light.as_ref().is_some_and(|light| light.emission.texture.is_some());
        let turned = self.state.reversed && (shines || in_object);
        let (place, to_world) = (params.place.clone(), self.state.to_world);
        let whole = if kind == "sphere" && !turned && !pictured { whole_sphere(params)? } else { None };
        let form = if let Some(radius) = whole
            && (in_object || solids::ball(to_world, DVec3::ZERO, 1.0).is_some())
        {
            Form::Ball(to_world, radius)
        } else if let Some(radius) = whole
            && !self.state.reversed
            && light.is_none()
        {
            return self.ellipsoid(to_world * DMat4::from_scale(DVec3::splat(radius)), material, &place);
        } else {
            let mesh = self.mesh(kind, params)?;
            if mesh.indices.is_empty() {
                self.load.ignored(&place, "the mesh has no faces");
            }
            Form::Mesh(mesh)
        };
        self.load.folder.build(form.surfaces(), &place)?;
        let emission = match light {
            Some(light) => {
                if light.power.is_some() && parts_of(kind, &form) > 1 {
                    let what = "`power` is that of all faces of a mesh together, where pbrt gives it to each";
                    self.load.approximated(&place, what);
                }
                Some(light.of_area(area(&form), &place)?)
            }
            None => None,
        };
        let wear = Wear { material, emission };
        let part = Part { form, wear, place };
        match &mut self.open_object {
            Some((_, parts)) => {
                parts.push(part);
                Ok(())
            }
            None => self.add(part, DMat4::IDENTITY),
        }
    }

    /// The triangles of a shape where the state is, with their fronts as it says.
    fn mesh(&mut self, kind: &str, params: &Params) -> Result<Triangles, LoadError> {
        let mut mesh = self.form(kind, params)?;
        mesh.check(&params.place)?;
        if self.is_textured() {
            mesh.map_each([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        }

        // The front is where shading normals point, or else the corners say so in the shape's own coordinates
        if self.state.reversed {
            mesh.normals.iter_mut().for_each(|normal| *normal = normal.map(|x| -x));
            if mesh.normals.is_empty() {
                mesh.indices.iter_mut().for_each(|triangle| triangle.swap(1, 2));
            }
        }
        mesh.place(self.state.to_world);
        Ok(mesh)
    }

    /// The triangles of a shape in its own coordinates.
    fn form(&mut self, kind: &str, params: &Params) -> Result<Triangles, LoadError> {
        match kind {
            "trianglemesh" => self.triangle_mesh(params),
            "bilinearmesh" => self.bilinear_mesh(params),
            "loopsubdiv" => self.subdivision(params),
            "plymesh" => self.ply_mesh(params),
            "sphere" | "cylinder" | "disk" | "cone" | "paraboloid" | "hyperboloid" => quadric(kind, params),
            _ => Err(params.place.unsupported(format!("Shape \"{kind}\""))),
        }
    }

    /// Where the shape is: a number or a texture, and what to call it.
    fn alpha(&mut self, params: &Params) -> Result<Option<(String, Texture)>, LoadError> {
        // The same for shadows is no other; what differs is said to be ignored
        if params.same("alpha", "shadowalpha") {
            params.ignore(&["shadowalpha"]);
        }
        let Some(param) = params.get("alpha") else { return Ok(None) };
        if param.kind == "texture" {
            let name = params.text("alpha")?.unwrap_or_default();
            let found = self.state.float_textures.get(name).cloned();
            let texture = found.ok_or_else(|| params.bad(format!("there is no texture `{name}`")))?;
            return Ok(Some((name.to_owned(), self.inside(&params.place, texture)?)));
        }
        let alpha = params.float("alpha")?.unwrap_or(1.0).clamp(0.0, 1.0) as f32;
        Ok((alpha < 1.0).then(|| (alpha.to_string(), Texture::Colour([alpha; 3]))))
    }

    fn triangle_mesh(&self, params: &Params) -> Result<Triangles, LoadError> {
        // Of textures that count faces, which are not read
        params.ignore(&["faceIndices"]);
        let uvs = match params.rows::<2>("uv")? {
            Some(uvs) => Some(uvs),
            None => params.rows::<2>("st")?,
        };
        let indices = corners::<3>(params, "indices")?.unwrap_or_else(|| vec![[0, 1, 2]]);
        vertices(params, uvs, indices)
    }

    /// Squares, each as two triangles.
    fn bilinear_mesh(&mut self, params: &Params) -> Result<Triangles, LoadError> {
        let corners = corners::<4>(params, "indices")?.unwrap_or_else(|| vec![[0, 1, 2, 3]]);
        // Corners come in rows
        let indices = corners.iter().flat_map(|[a, b, c, d]| [[*a, *b, *d], [*a, *d, *c]]).collect();
        self.load.approximated(&params.place, "a bilinear patch is replaced by two triangles");
        vertices(params, params.rows::<2>("uv")?, indices)
    }

    /// Loop's subdivision of a mesh, whose vertices lie on its limit.
    fn subdivision(&mut self, params: &Params) -> Result<Triangles, LoadError> {
        params.ignore(&["scheme"]);
        let positions = points(params)?;
        let indices = corners::<3>(params, "indices")?.ok_or_else(|| params.bad("a mesh needs `indices`"))?;
        // Version 3 calls them nlevels
        let name = if params.get("levels").is_some() { "levels" } else { "nlevels" };
        let levels = params.float(name)?.unwrap_or(3.0).max(0.0) as u32;
        let mut mesh = Triangles { positions, indices, ..Triangles::default() };
        mesh.check(&params.place)?;
        let after = subdivide::triangles_after(mesh.indices.len() as u64, levels).unwrap_or(u64::MAX);
        params.place.at_most("triangles of a subdivision", after, self.load.folder.unbuilt())?;
        has_memory(after, SUBDIVIDING, &params.place)?;
        Ok(subdivide::subdivide(&mesh, levels))
    }

    fn ply_mesh(&mut self, params: &Params) -> Result<Triangles, LoadError> {
        let name = params.text("filename")?.ok_or_else(|| params.bad("a plymesh needs a `filename`"))?;
        for relief in ["displacement", "displacement.edgelength"] {
            if params.get(relief).is_some() {
                self.load.ignored(&params.place, "the displacement of a mesh is left out");
            }
        }
        let path = self.load.folder.find(name, &params.place)?;
        let bytes = self.bytes_of(&path, MAX_FILE_BYTES, &params.place)?;
        let mesh = ply::parse(&bytes, &path)?;
        for unread in &mesh.unread {
            self.load.ignored(&Place::file(&path), format!("{unread} is ignored"));
        }
        Ok(mesh)
    }
}

fn points(params: &Params) -> Result<Vec<[f32; 3]>, LoadError> {
    params.rows::<3>("P")?.ok_or_else(|| params.bad("a mesh needs its points `P`"))
}

/// A mesh whose normals and texture coordinates are as many as its points.
fn vertices(
    params: &Params,
    uvs: Option<Vec<[f32; 2]>>,
    indices: Vec<[u32; 3]>,
) -> Result<Triangles, LoadError> {
    let (positions, uvs) = (points(params)?, uvs.unwrap_or_default());
    let normals = params.rows::<3>("N")?.unwrap_or_default();
    for (name, found) in [("N", normals.len()), ("uv", uvs.len())] {
        if found != 0 && found != positions.len() {
            return Err(params.bad(format!("`{name}` has {found} rows for {} points", positions.len())));
        }
    }
    Ok(Triangles { positions, normals, uvs, indices, ..Triangles::default() })
}

/// How many shapes a shape is to pbrt, each of which is a light of its own.
fn parts_of(kind: &str, form: &Form) -> usize {
    match (kind, form) {
        ("trianglemesh" | "plymesh" | "loopsubdiv", Form::Mesh(mesh)) => mesh.indices.len(),
        ("bilinearmesh", Form::Mesh(mesh)) => mesh.indices.len() / 2,
        _ => 1,
    }
}

/// The radius of a sphere of which nothing is cut off.
fn whole_sphere(params: &Params) -> Result<Option<f64>, LoadError> {
    let radius = positive(params, "radius", 1.0)?;
    let number = |name: &str, missing: f64| Ok::<_, LoadError>(params.float(name)?.unwrap_or(missing));
    let whole = number("zmin", -radius)? <= -radius
        && number("zmax", radius)? >= radius
        && number("phimax", 360.0)? >= 360.0;
    Ok(whole.then_some(radius))
}

/// The area of a shape where it is.
fn area(form: &Form) -> f64 {
    match form {
        Form::Mesh(mesh) => mesh.area(),
        Form::Ball(to_world, radius) => {
            let scale = DMat3::from_mat4(*to_world).determinant().abs().cbrt();
            4.0 * PI * (scale * radius).powi(2)
        }
    }
}

/// A quadric as triangles, or a part of it.
fn quadric(kind: &str, params: &Params) -> Result<Triangles, LoadError> {
    let number = |name: &str, missing: f64| Ok(params.float(name)?.unwrap_or(missing));
    let sweep = number("phimax", 360.0)?.clamp(0.0, 360.0).to_radians();
    if kind == "hyperboloid" {
        let point = |name, missing| {
            Ok(params.rows::<3>(name)?.and_then(|rows| rows.first().copied()).unwrap_or(missing))
        };
        let [from, to] = [point("p1", [0.0; 3])?, point("p2", [1.0; 3])?].map(|p| Vec3::from(p).as_dvec3());
        return Ok(solids::turned(sweep, false, |v| [from.lerp(to, v), to - from]));
    }
    let radius = positive(params, "radius", 1.0)?;
    Ok(match kind {
        "sphere" => {
            let (low, high) = (number("zmin", -radius)?, number("zmax", radius)?);
            let angle = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
            let (bottom, top) = (angle(low.min(high)), angle(low.max(high)));
            solids::turned(sweep, false, |v| {
                let (sin, cos) = (bottom + (top - bottom) * v).sin_cos();
                [DVec3::new(sin, 0.0, cos) * radius, DVec3::new(-cos, 0.0, sin)]
            })
        }
        "cylinder" => {
            let (low, high) = (number("zmin", -1.0)?, number("zmax", 1.0)?);
            let (low, high) = (low.min(high), low.max(high));
            solids::turned(sweep, true, |v| [DVec3::new(radius, 0.0, low + (high - low) * v), DVec3::Z])
        }
        "disk" => {
            let (inner, height) =
                (number("innerradius", 0.0)?.clamp(0.0, 0.999 * radius), number("height", 0.0)?);
            solids::turned(sweep, true, |v| {
                [DVec3::new(radius + (inner - radius) * v, 0.0, height), DVec3::NEG_X]
            })
        }
        "cone" => {
            let height = number("height", 1.0)?;
            solids::turned(sweep, true, |v| {
                [DVec3::new(radius * (1.0 - v), 0.0, height * v), DVec3::new(-radius, 0.0, height)]
            })
        }
        // A paraboloid, whose radius is that at the height zmax
        _ => {
            let (low, high) = (number("zmin", 0.0)?, number("zmax", 1.0)?);
            let (low, high) = (low.min(high), low.max(high));
            if !(low >= 0.0 && high > low) {
                return Err(params.bad(format!("a paraboloid from {low} to {high}; it must lie above 0")));
            }
            solids::turned(sweep, false, |v| {
                let z = low + (high - low) * v;
                [
                    DVec3::new(radius * (z / high).sqrt(), 0.0, z),
                    DVec3::new(radius, 0.0, 2.0 * (z * high).sqrt()),
                ]
            })
        }
    })
}

/// A number above 0.
fn positive(params: &Params, name: &str, missing: f64) -> Result<f64, LoadError> {
    match params.float(name)?.unwrap_or(missing) {
        x if x > 0.0 => Ok(x),
        x => Err(params.bad(format!("`{name}` is {x}; it must be above 0"))),
    }
}

/// Rows of indices.
fn corners<const N: usize>(params: &Params, name: &str) -> Result<Option<Vec<[u32; N]>>, LoadError> {
    let Some(numbers) = params.numbers(name)? else { return Ok(None) };
    if numbers.len() % N != 0 || !numbers.iter().all(|x| (0.0..4e9).contains(x) && x.fract() == 0.0) {
        return Err(params.bad(format!("`{name}` must be whole numbers of at least 0, a multiple of {N}")));
    }
    let row = |row: &[f64]| std::array::from_fn(|i| row[i] as u32);
    Ok(Some(numbers.chunks_exact(N).map(row).collect()))
}
