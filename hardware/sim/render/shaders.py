"""What the graphics processor, or Mesa in its place, computes for each vertex and pixel.

It is the light of OpenGL's fixed functions, by which MuJoCo draws: reckoned at the vertices by Blinn and Phong, cut off
at full scale for what throws no shadow together and for each lamp that throws one, each rounded to whole levels, and
added. But all of it in one pass over the scene, where MuJoCo takes one more for each lamp with shadows.

World frame; matrices take row vectors' transposes, as NumPy has them, and are uploaded transposed.
"""

from __future__ import annotations

from typing import Final

MOST_LAMPS: Final = 8
"""As OpenGL's fixed functions have."""
MOST_SHADOWS: Final = 4
"""Lamps that throw shadows."""

ATTRIBUTES: Final = ("place", "normal", "row0", "row1", "row2", "size", "colour", "gloss")
"""Of a vertex the first two; the others of an instance: rows of the matrix (rotation, origin), half sizes, colour with
alpha, and specular, shininess, emission and spare."""

_INSTANCE: Final = """
in vec4 place; in vec3 normal;
in vec4 row0; in vec4 row1; in vec4 row2; in vec4 size; in vec4 colour; in vec4 gloss;
uniform mat4 view;

vec3 stretched() { return vec3(place.xy * size.xy, place.z * size.z + place.w * size.x); }
vec3 moved(vec3 p) { vec4 q = vec4(p, 1.0); return vec3(dot(row0, q), dot(row1, q), dot(row2, q)); }
"""

DEPTH_VERTEX: Final = f"""#version 330
{_INSTANCE}
void main() {{ gl_Position = view * vec4(moved(stretched()), 1.0); }}
"""
DEPTH_PIXEL: Final = """#version 330
void main() {}
"""

_LIT_VERTEX: Final = """
uniform vec3 eye;
uniform float ellipsoid;
uniform vec2 repeat;
uniform int lamps; uniform int matt_lamps;
uniform vec3 ambient;
uniform vec3 matt_towards[8]; uniform vec3 matt_diffuse[8];
uniform mat4 shadow_view[4];
uniform vec4 lamp_place[8]; uniform vec4 lamp_axis[8]; uniform vec4 lamp_fading[8];
uniform vec3 lamp_ambient[8]; uniform vec3 lamp_diffuse[8]; uniform vec3 lamp_specular[8];
out vec3 steady;
#if TEXTURED
out vec2 spot;
#endif
#if SHADOWS
out vec3 thrown[SHADOWS];
out vec4 hidden[SHADOWS];
#endif

vec3 lit_by(int i, vec3 p, vec3 n, vec3 to_eye) {
    vec3 to_lamp = normalize(lamp_place[i].xyz - lamp_place[i].w * p);
    float strength = 1.0;
    if (lamp_place[i].w > 0.0) {
        float off = dot(-to_lamp, lamp_axis[i].xyz);
        float r = distance(lamp_place[i].xyz, p);
        strength = off < lamp_axis[i].w ? 0.0 : pow(max(off, 0.0), lamp_fading[i].w);
        strength /= lamp_fading[i].x + r * (lamp_fading[i].y + r * lamp_fading[i].z);
    }
    float facing = dot(n, to_lamp);
    vec3 light = lamp_ambient[i] * colour.rgb;
    if (facing > 0.0) {
        light += facing * lamp_diffuse[i] * colour.rgb;
        float shine = max(dot(n, normalize(to_lamp + to_eye)), 0.0);
        light += (gloss.y > 0.0 ? pow(shine, gloss.y) : 1.0) * gloss.x * lamp_specular[i];
    }
    return strength * light;
}

void main() {
    vec3 object = stretched();
    vec3 p = moved(object);
    vec3 bent = mix(normal, normal / size.xyz, ellipsoid);
    vec3 n = normalize(vec3(dot(row0.xyz, bent), dot(row1.xyz, bent), dot(row2.xyz, bent)));
    vec3 to_eye = normalize(eye - p);
    gl_Position = view * vec4(p, 1.0);
    vec3 light = (gloss.z + ambient) * colour.rgb;
    for (int i = 0; i < matt_lamps; i++) light += max(dot(n, matt_towards[i]), 0.0) * matt_diffuse[i] * colour.rgb;
    for (int i = SHADOWS; i < lamps; i++) light += lit_by(i, p, n, to_eye);
    steady = clamp(light, 0.0, 1.0);
#if SHADOWS
    for (int i = 0; i < SHADOWS; i++) {
        thrown[i] = clamp(lit_by(i, p, n, to_eye), 0.0, 1.0);
        hidden[i] = shadow_view[i] * vec4(p, 1.0);
    }
#endif
#if TEXTURED
    spot = vec2(0.5, -0.5) * repeat * place.xy - 0.5;
#endif
}
"""

_LIT_PIXEL: Final = """
in vec3 steady;
#if TEXTURED
in vec2 spot;
uniform sampler2D picture;
#endif
#if SHADOWS
in vec3 thrown[SHADOWS];
in vec4 hidden[SHADOWS];
uniform sampler2DShadow shadow[SHADOWS];
#endif
out vec4 pixel;

vec3 whole(vec3 light) { return floor(255.0 * light + 0.5) / 255.0; }

void main() {
#if TEXTURED
    vec3 paint = texture(picture, spot).rgb;
#else
    const vec3 paint = vec3(1.0);
#endif
    vec3 light = whole(paint * steady);
SHADE
    pixel = vec4(light, 1.0);
}
"""

SKY_VERTEX: Final = """#version 330
uniform mat4 back;
out vec3 towards;
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    towards = (back * vec4(corner, 1.0, 1.0)).xyz;
    gl_Position = vec4(corner, 0.0, 1.0);
}
"""
"""One triangle over the whole picture, at the far end; ``back`` takes a corner to the direction in which it is seen."""
SKY_PIXEL: Final = """#version 330
in vec3 towards;
uniform samplerCube room;
out vec4 pixel;
void main() { pixel = vec4(texture(room, vec3(towards.x, towards.z, -towards.y)).rgb, 1.0); }
"""


def lit_vertex(*, textured: bool, shadows: int) -> str:
    """The program of a vertex, for so many lamps that throw shadows."""
    return _with(textured, shadows) + _INSTANCE + _LIT_VERTEX


def lit_pixel(*, textured: bool, shadows: int) -> str:
    """The program of a pixel."""
    shade = "".join(
        f"    light += textureProj(shadow[{i}], hidden[{i}]) * paint * thrown[{i}];\n" for i in range(shadows)
    )
    return _with(textured, shadows) + _LIT_PIXEL.replace("SHADE\n", shade)


def _with(textured: bool, shadows: int) -> str:
    return f"#version 330\n#define TEXTURED {int(textured)}\n#define SHADOWS {shadows}\n"
