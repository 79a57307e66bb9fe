"""The panel in Render Properties, inside Cycles' Sampling."""

import bpy

from . import hooks


class RENDER_PT_noisefloor(bpy.types.Panel):
    bl_label = "Render until nobody sees noise"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_parent_id = "CYCLES_RENDER_PT_sampling"
    COMPAT_ENGINES = {"CYCLES"}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw_header(self, context):
        self.layout.prop(context.scene.noisefloor, "use", text="")

    def draw(self, context):
        settings, layout = context.scene.noisefloor, self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        column = layout.column()
        column.active = settings.use
        column.prop(settings, "viewing")
        denoised = context.scene.cycles.use_denoising
        column.prop(settings, *(["lost"] if denoised else ["people"]), slider=not denoised)
        column.prop(settings, "max_samples")
        column.prop(settings, "time_limit")
        column.prop(context.scene.cycles, "use_denoising", text="Denoise", toggle=False)
        column.prop(settings, "write_maps")
        if hooks.state.summary:
            box = column.box()
            for part in hooks.state.summary.replace("), ", "); ").split("; "):
                box.label(text=part)
