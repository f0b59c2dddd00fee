"""What is around the robot: theme, light and floor."""

import viser

from server.messages import View
from server.nodes import COLORS


def configure_scene(server: viser.ViserServer, view: View) -> None:
    """Light or dark; low graphics means no environment light and no shadows."""
    server.gui.configure_theme(
        dark_mode=view.dark,
        show_logo=False,
        show_share_button=False,
        control_width="small",
        brand_color=COLORS["actual"],
    )
    scene = server.scene
    high = view.graphics == "high"
    scene.configure_default_lights(enabled=True, cast_shadow=high)
    scene.configure_environment_map("studio" if high else None, environment_intensity=0.25)
    # Without an environment map nothing lights what faces away from the lamps.
    scene.add_light_ambient("/ambient", intensity=0.0 if high else 1.2)
    scene.add_grid(
        "/floor",
        infinite_grid=True,
        cell_size=0.1,
        section_size=0.5,
        cell_color=(52, 58, 70) if view.dark else (226, 230, 236),
        section_color=(74, 84, 100) if view.dark else (196, 204, 214),
        fade_distance=9.0,
        shadow_opacity=0.25 if high else 0.0,
    )
