"""Light, haze and soil of frames as programs of the graphics card; the pages' scripts have the same formulas."""

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor, vtkCamera, vtkTexture

from rover_gym.show.frames import appearance as look
from rover_gym.show.frames.appearance import BOUNCE_LIGHT, HAZE, SKY_COLOUR, SKY_LIGHT, SUN_LIGHT, TILE

Array = npt.NDArray[np.float64]

GRAIN = "grain"  # the soil's texture
LEVEL = 0.7  # upward part of the normal of a mesh's faces that show tiles


def _rgb(colour: look.Colour) -> str:
    return "vec3({:.4f}, {:.4f}, {:.4f})".format(*colour)


#: The sky's light from above, the ground's from below, and the Sun's. A scene's first light shines from the Sun and the
#: second from the zenith; only their directions count. `albedo` is a surface's colour, `facing` its normal and `sunlit`
#: the share of the Sun that reaches it.
LIT = f"""
  vec3 skylight = mix({_rgb(BOUNCE_LIGHT)}, {_rgb(SKY_LIGHT)}, 0.5 + 0.5 * dot(facing, -lightDirectionVC1));
  vec3 light = skylight + sunlit * {_rgb(SUN_LIGHT)} * max(0.0, dot(facing, -lightDirectionVC0));
  float haze = smoothstep({HAZE[0]:.1f}, {HAZE[1]:.1f}, -vertexVC.z);
  fragOutput0 = vec4(mix(albedo * light, {_rgb(SKY_COLOUR)}, haze), opacity);
"""

SOIL = f"""
  vec2 at = (worldOfView * vertexVC).xz;
  vec2 edge = abs(fract(0.5 * at / tile + 0.25) - 0.5) * 2.0 - 0.5; // signed, changes at every line
  vec2 wide = max(fwidth(at) / tile, 1e-4);
  vec2 side = clamp(edge / wide, -0.5, 0.5) * 2.0;
  float checks = 0.5 + 0.5 * side.x * side.y;
  if (dot(facing, -lightDirectionVC1) < level) checks = 1.0;
  vec3 albedo = mix(lighter, darker, checks);
  albedo *= 0.72 + 0.3 * texture({GRAIN}, at * 0.9).r + 0.26 * texture({GRAIN}, at * 0.071 + 0.3).r;
"""


TONES = ("lighter", "darker")  # fields of the checkered ground


def dress(actor: vtkActor) -> None:
    """Lights a surface as pages do."""
    _replace(actor, "vec3 albedo = diffuseColor, facing = normalVCVSOutput; float sunlit = 1.0;" + LIT)


def _replace(actor: vtkActor, code: str) -> None:
    actor.GetShaderProperty().AddFragmentShaderReplacement("//VTK::Light::Impl", True, code, False)


class SoilShading:
    """The look of the ground, for all surfaces of a scene that show it.

    Args:
        tile: Edge of its tiles, m.
        sand: Whether it is sand.
    """

    def __init__(self, tile: float = TILE, *, sand: bool = False) -> None:
        self._tile = tile
        self._colours = look.SAND_GROUND if sand else (look.GROUND_COLOUR, look.GROUND_COLOUR_2)
        self._world = vtkMatrix4x4()
        self._actors: list[vtkActor] = []
        self._grain = _grain()

    def dress(self, actor: vtkActor, *, sunlit: bool = True, steep: bool = False) -> None:
        """Shows soil on a surface, in the Sun or in a shadow; steep faces of a mesh show no tiles."""
        facing = "normalVCVSOutput" if sunlit else "-lightDirectionVC1"  # a shadow is a flat body, without normals
        level = f"vec3 facing = {facing}; float level = {LEVEL if steep else -2.0:.2f};"
        level += f" float sunlit = {float(sunlit):.1f}, tile = {self._tile:.6f};"
        level += "".join(f" vec3 {name} = {_rgb(colour)};" for name, colour in zip(TONES, self._colours, strict=True))
        shading = actor.GetShaderProperty()
        shading.ClearAllFragmentShaderReplacements()
        _replace(actor, level + SOIL + LIT)
        shading.GetFragmentCustomUniforms().SetUniformMatrix("worldOfView", self._world)
        actor.GetProperty().SetTexture(GRAIN, self._grain)
        self._actors.append(actor)

    def see(self, camera: vtkCamera) -> None:
        """Takes over where a camera stands."""
        self._world.DeepCopy(camera.GetViewTransformMatrix())
        self._world.Invert()
        self._world.Transpose()  # OpenGL's order
        for actor in self._actors:
            actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniformMatrix("worldOfView", self._world)


def _grain() -> vtkTexture:
    image = vtkImageData()
    values = look.grain()
    rows, columns = values.shape
    image.SetDimensions(columns, rows, 1)
    levels = np.round(255.0 * values).astype(np.uint8).reshape(-1, 1)
    image.GetPointData().SetScalars(numpy_to_vtk(np.repeat(levels, 3, axis=1), deep=True))
    texture = vtkTexture()
    texture.SetInputData(image)
    texture.RepeatOn()
    texture.InterpolateOn()
    texture.MipmapOn()
    texture.SetMaximumAnisotropicFiltering(1.0)  # in software, more costs many times the rest of a frame
    return texture
