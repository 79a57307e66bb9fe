//! Groups of shapes, and their instances.

use super::context::Context;
use super::filling::{Filling, Group};
use super::xml::Element;
use crate::error::LoadError;
use crate::mesh::rows;
use noisefloor_ptwne::SceneError;

/// Most triangles that are made: of round shapes, and of lamps in instances. A short file can ask for any number.
const MAX_MADE: u64 = 1 << 23;

impl<'d> Context<'d> {
    /// Shows the shapes of a group, moved.
    pub(super) fn instance(&self, element: &'d Element, filling: &mut Filling<'d>) -> Result<(), LoadError> {
        let groups = self.parts(element, "shape")?;
        let [group] = groups.as_slice() else {
            return Err(self.bad(element, "an instance needs one <shape type=\"shapegroup\">, by reference"));
        };
        if group.kind() != "shapegroup" {
            return Err(self.bad(element, format!("an instance of {}; expected a shapegroup", group.label())));
        }
        let to_world = self.transform(element, "to_world")?;
        if !filling.groups.contains_key(&group.serial) {
            // What is wrong with a group is said once
            filling.groups.insert(group.serial, None);
            let made = self.group(group, filling)?;
            filling.groups.insert(group.serial, Some(made));
        }
        let Some(Some(Group { shared, shining })) = filling.groups.get(&group.serial).cloned() else {
            return Ok(());
        };
        match filling.builder.instance(shared, rows(to_world)) {
            Err(SceneError::Singular) => {
                self.ignored(element, "an instance is left out: its transform is singular");
                return Ok(());
            }
            shown => shown.map_err(self.refused(element))?,
        }
        shining.iter().try_for_each(|shape| self.simple(shape, Some(to_world), filling))
    }

    /// Adds the shapes of a group that its instances share.
    fn group(&self, group: &'d Element, filling: &mut Filling<'d>) -> Result<Group<'d>, LoadError> {
        let (mut shining, mut plain) = (vec![], vec![]);
        for shape in self.merged(group)? {
            if matches!(shape.kind(), "shapegroup" | "instance") {
                return Err(self.unsupported(shape, "an instance in a group"));
            }
            let lamp = !self.parts(shape, "emitter")?.is_empty();
            if lamp { &mut shining } else { &mut plain }.push(shape);
        }
        filling.builder.begin_object().map_err(self.refused(group))?;
        filling.in_group = true;
        let added = plain.into_iter().try_for_each(|shape| self.simple(shape, None, filling));
        filling.in_group = false;
        let shared = filling.builder.end_object().map_err(self.refused(group))?;
        added.map(|()| Group { shared, shining })
    }

    /// The shapes in an element; of those that are a `merge`, the shapes in them.
    pub(super) fn merged(&self, element: &'d Element) -> Result<Vec<&'d Element>, LoadError> {
        let mut all = Vec::new();
        for shape in self.parts(element, "shape")? {
            match shape.kind() {
                "merge" => all.extend(self.nested_in(shape, || self.merged(shape))?),
                _ => all.push(shape),
            }
            self.spend(element, all.len())?;
        }
        Ok(all)
    }

    /// Counts triangles that are made, and refuses more than [`MAX_MADE`].
    pub(super) fn count_made(
        &self,
        element: &Element,
        count: usize,
        filling: &mut Filling<'d>,
    ) -> Result<(), LoadError> {
        filling.made = filling.made.saturating_add(count as u64);
        self.place(element).at_most("triangles made of shapes so far", filling.made, MAX_MADE)
    }
}
