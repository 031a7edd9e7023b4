//! A view of placed solids: exact rays, soft daylight, drawn edges.
//!
//! Idea: every sample of the image is one ray through the trees (`ray`), so holes, seams and subtracted surfaces are
//! exact at any scale and nothing is tessellated. Light: a sun with a wide disc (one jittered shadow ray a sample), a sky,
//! and occlusion of the near surroundings read from f itself, which is a distance near the surface (after I. Quilez,
//! "distance field ambient occlusion", 2008). Edges are drawn where the object, or the normal, changes between samples.
//! Invariant: same scene, same pixels, on any number of threads. Not promised: physically meant light.

use super::ray::{Ray, Span, Traced};
use crate::math::Aabb;
use contactd_proto::Pose;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// A colour: linear red, green, blue in 0..1.
pub type Rgb = [f64; 3];

/// A wedge that is cut away: the points above all of these planes (unit normal, offset; world frame).
pub type Cut = Vec<(DVec3, f64)>;

/// One placed solid of a picture.
#[derive(Debug)]
pub struct Thing<'a> {
    /// Its solid, prepared.
    pub traced: &'a Traced<'a>,
    /// Where it is.
    pub pose: Pose,
    /// Its colour.
    pub color: Rgb,
    /// What is cut away from it to look inside.
    pub cut: Option<Cut>,
}

impl Thing<'_> {
    /// Its box in the world, from the corners of its own one.
    pub fn aabb(&self) -> Aabb {
        Aabb::of_points(self.traced.aabb().corners().into_iter().map(|c| self.pose.point(c)))
    }
}

/// A perspective camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// Unit vectors: right, up, forward.
    frame: [DVec3; 3],
    /// Pixels per unit of (lateral / forward).
    focal: f64,
    /// (lateral / forward) at the image's middle.
    middle: DVec2,
    /// Image size in pixels.
    pub size: (usize, usize),
}

impl Camera {
    /// A camera that sees all of `target`, from the direction `from` (towards the camera), z upwards.
    pub fn framing(target: &[Aabb], from: DVec3, size: (usize, usize)) -> Self {
        let forward = -from.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let up = right.cross(forward);
        let corners: Vec<DVec3> = target.iter().flat_map(|b| b.corners()).collect();
        let whole = Aabb::of_points(corners.iter().copied());
        let radius = whole.half().length().max(1e-12);
        // Far enough for a calm perspective; then the smallest field that holds every corner, centred on it.
        let mut camera = Self {
            eye: whole.center() - forward * (5.0 * radius),
            frame: [right, up, forward],
            focal: 1.0,
            middle: DVec2::ZERO,
            size,
        };
        for _ in 0..4 {
            let at: Vec<DVec2> = corners.iter().map(|c| camera.plane(*c)).collect();
            let low = at.iter().copied().reduce(DVec2::min).unwrap_or_default();
            let high = at.iter().copied().reduce(DVec2::max).unwrap_or_default();
            let middle = 0.5 * (low + high);
            camera.eye += (right * middle.x + up * middle.y) * (5.0 * radius);
            let span = (high - low).max(DVec2::splat(1e-12));
            camera.focal = 0.94 * (size.0 as f64 / span.x).min(size.1 as f64 / span.y);
        }
        camera
    }

    fn plane(&self, x: DVec3) -> DVec2 {
        let v = x - self.eye;
        DVec2::new(v.dot(self.frame[0]), v.dot(self.frame[1])) / v.dot(self.frame[2])
    }

    /// The pixel (from the upper left) where a world point is seen.
    pub fn pixel(&self, x: DVec3) -> DVec2 {
        let p = (self.plane(x) - self.middle) * self.focal;
        DVec2::new(0.5 * self.size.0 as f64 + p.x, 0.5 * self.size.1 as f64 - p.y)
    }

    /// The ray through a pixel position.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let (u, v) = ((x - 0.5 * self.size.0 as f64) / self.focal, (0.5 * self.size.1 as f64 - y) / self.focal);
        let (u, v) = (u + self.middle.x, v + self.middle.y);
        let direction = (self.frame[2] + self.frame[0] * u + self.frame[1] * v).normalize();
        Ray { origin: self.eye, direction }
    }

    /// The same view, zoomed until the pixels from `low` to `high` fill the image.
    pub fn zoomed(mut self, low: DVec2, high: DVec2) -> Self {
        let size = DVec2::new(self.size.0 as f64, self.size.1 as f64);
        let off = 0.5 * (low + high) - 0.5 * size;
        self.middle += DVec2::new(off.x, -off.y) / self.focal;
        let fill = size / (high - low).max(DVec2::ONE);
        self.focal *= 0.92 * fill.x.min(fill.y);
        self
    }

    /// World length that one pixel spans at `x`.
    pub fn pixel_length(&self, x: DVec3) -> f64 {
        (x - self.eye).dot(self.frame[2]) / self.focal
    }
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
struct Hit {
    object: u32,
    face: u32,
    at: f64,
    point: DVec3,
    normal: DVec3,
}

/// Object number of the ground.
const GROUND: u32 = u32::MAX;
/// Face number of a cut surface.
const CUT_FACE: u32 = u32::MAX;
/// Rows of pixels that one thread makes at a time: their margin's samples, which the next ones find once more, are then few.
const BAND: usize = 8;

/// What is seen, and how finely it is sampled.
#[derive(Debug)]
pub struct View<'a> {
    /// The placed solids.
    pub things: Vec<Thing<'a>>,
    /// The camera.
    pub camera: Camera,
    /// Height of a white ground that takes shadows.
    pub ground: Option<f64>,
    /// Samples a pixel along each side.
    pub samples: usize,
}

impl View<'_> {
    /// The image, rows from the top, 8-bit sRGB.
    pub fn render(&self) -> Vec<[u8; 3]> {
        let boxes: Vec<Aabb> = self.things.iter().map(Thing::aabb).collect();
        let size = Aabb::of_points(boxes.iter().flat_map(|b| b.corners())).half().length().max(1e-12);
        let (w, h, n) = (self.camera.size.0, self.camera.size.1, self.samples.max(1));
        let margin = (n / 2).max(1);
        let band = |first: usize| {
            // The hits of a band of rows with a margin of samples around it, for the edges.
            let rows = BAND.min(h - first);
            let (width, height) = (w * n + 2 * margin, rows * n + 2 * margin);
            let mut hits: Vec<Option<Hit>> = Vec::with_capacity(width * height);
            for j in 0..height {
                for i in 0..width {
                    let at = |k: usize| (k as f64 + 0.5 - margin as f64) / n as f64;
                    let ray = self.camera.ray(at(i), first as f64 + at(j));
                    hits.push(self.first_hit(&ray, &boxes));
                }
            }
            let pixel = |(row, column): (usize, usize)| {
                let mut sum = [0.0; 3];
                for j in 0..n {
                    for i in 0..n {
                        let k = (row * n + j + margin) * width + column * n + i + margin;
                        let jitter = sample_jitter(column * n + i, (first + row) * n + j, n);
                        let color = self.shade(hits[k].as_ref(), jitter, &boxes, size);
                        let line = edge_weight(&hits, k, width, margin);
                        for c in 0..3 {
                            sum[c] += color[c] * (1.0 - line) + 0.02 * line;
                        }
                    }
                }
                sum.map(|c| encode(c / (n * n) as f64))
            };
            (0..rows).flat_map(|row| (0..w).map(move |column| (row, column))).map(pixel).collect::<Vec<_>>()
        };
        (0..h.div_ceil(BAND)).into_par_iter().map(|k| band(k * BAND)).collect::<Vec<_>>().concat()
    }

    /// True when nothing stands between the camera and a surface point.
    pub fn sees(&self, x: DVec3) -> bool {
        let boxes: Vec<Aabb> = self.things.iter().map(Thing::aabb).collect();
        let away = x - self.camera.eye;
        let ray = Ray { origin: self.camera.eye, direction: away.normalize() };
        let slack = 2.0 * self.camera.pixel_length(x);
        self.first_hit(&ray, &boxes).is_none_or(|h| h.at > away.length() - slack)
    }

    /// Zooms until what is seen of the things fills the image: boxes are larger than what they hold.
    pub fn zoom_to_things(&mut self) {
        let boxes: Vec<Aabb> = self.things.iter().map(Thing::aabb).collect();
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let step = (self.camera.size.0 / 200).max(1);
        for y in (0..self.camera.size.1).step_by(step) {
            for x in (0..self.camera.size.0).step_by(step) {
                let at = DVec2::new(x as f64, y as f64);
                if self.first_hit(&self.camera.ray(at.x, at.y), &boxes).is_some_and(|h| h.object != GROUND) {
                    low = low.min(at - step as f64);
                    high = high.max(at + step as f64);
                }
            }
        }
        if low.x < high.x {
            self.camera = self.camera.zoomed(low, high);
        }
    }

    fn first_hit(&self, ray: &Ray, boxes: &[Aabb]) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (i, thing) in self.things.iter().enumerate() {
            let Some((enter, leave)) = ray.through(&boxes[i]) else { continue };
            if leave < 0.0 || best.is_some_and(|b| b.at < enter) {
                continue;
            }
            let local = in_frame(ray, &thing.pose);
            for span in visible(thing.traced.spans(&local), thing.cut.as_ref(), ray) {
                let c = span.0;
                if c.at > 1e-9 && best.is_none_or(|b| c.at < b.at) {
                    let point = ray.at(c.at);
                    let normal = if c.face == CUT_FACE {
                        cut_normal(thing.cut.as_deref().unwrap_or(&[]), point)
                    } else {
                        let face = &thing.traced.solid.faces[c.face as usize];
                        let n = face.unit_normal(local.at(c.at));
                        thing.pose.vector(if c.outward { n } else { -n })
                    };
                    best = Some(Hit { object: i as u32, face: c.face, at: c.at, point, normal });
                }
                if c.at > 1e-9 {
                    break;
                }
            }
        }
        if let Some(z) = self.ground {
            let t = (z - ray.origin.z) / ray.direction.z;
            if t > 0.0 && t.is_finite() && best.is_none_or(|b| t < b.at) {
                best = Some(Hit { object: GROUND, face: 0, at: t, point: ray.at(t), normal: DVec3::Z });
            }
        }
        best
    }

    fn shadowed(&self, ray: &Ray, boxes: &[Aabb]) -> bool {
        self.things.iter().enumerate().any(|(i, thing)| {
            ray.through(&boxes[i]).is_some_and(|(_, leave)| leave > 0.0)
                && visible(thing.traced.spans(&in_frame(ray, &thing.pose)), thing.cut.as_ref(), ray)
                    .iter()
                    .any(|s| s.1.at > 1e-9)
        })
    }

    /// 0 (buried) to 1 (open): how far the surroundings stay away along the normal.
    fn openness(&self, x: DVec3, normal: DVec3, boxes: &[Aabb], size: f64) -> f64 {
        let mut closed = 0.0;
        for (k, weight) in [(0.008, 0.38), (0.02, 0.28), (0.045, 0.2), (0.09, 0.14)] {
            let step = k * size;
            let at = x + normal * step;
            let mut free = step;
            for (i, thing) in self.things.iter().enumerate() {
                let b = &boxes[i];
                if (b.min - at).max(at - b.max).max(DVec3::ZERO).length() < free {
                    let mut f = thing.traced.clearance(thing.pose.inverse().point(at), free);
                    if let Some(cut) = &thing.cut {
                        let inside_cut = cut.iter().fold(f64::INFINITY, |m, (n, d)| m.min(n.dot(at) - d));
                        f = f.max(inside_cut);
                    }
                    free = free.min(f);
                }
            }
            if let Some(z) = self.ground {
                free = free.min(at.z - z);
            }
            closed += weight * (1.0 - (free / step).clamp(0.0, 1.0));
        }
        1.0 - closed
    }

    fn shade(&self, hit: Option<&Hit>, jitter: DVec2, boxes: &[Aabb], size: f64) -> Rgb {
        let Some(hit) = hit else { return [1.0; 3] };
        let n = hit.normal;
        let toward = (self.camera.eye - hit.point).normalize();
        // The sun stands over the camera's left shoulder; its disc is wide, hence soft shadows.
        let [right, up, forward] = self.camera.frame;
        let sun = (-right * 0.55 + up * 0.25 - forward * 0.55 + DVec3::Z * 0.85).normalize();
        let side = sun.cross(DVec3::X).normalize();
        let spread = 0.07;
        let light = (sun + (side * jitter.x + side.cross(sun) * jitter.y) * spread).normalize();
        let start = hit.point + n * (1e-6 * size);
        let facing = n.dot(light);
        let lit = facing > 0.0 && !self.shadowed(&Ray { origin: start, direction: light }, boxes);
        let open = self.openness(hit.point, n, boxes, size);
        let direct = if lit { facing } else { 0.0 };
        if hit.object == GROUND {
            // White where nothing happens, darker only by shadow.
            let free = sun.z;
            let shade = (0.55 * (direct / free).min(1.0) + 0.45) * open;
            return [1.0 - 0.72 * (1.0 - shade); 3];
        }
        let thing = &self.things[hit.object as usize];
        let mut base = thing.color;
        if hit.face == CUT_FACE {
            // Sections are hatched, as in a drawing.
            let stripe = ((hit.point.x + hit.point.y + hit.point.z) / (0.02 * size)).rem_euclid(1.0) < 0.28;
            base = base.map(|c| if stripe { 0.45 * c } else { 0.25 + 0.75 * c.sqrt() });
        }
        let sky = 0.42 + 0.18 * n.z + 0.12 * n.dot(toward);
        let half = (light + toward).normalize();
        let shine = if lit { 0.22 * n.dot(half).max(0.0).powi(40) } else { 0.0 };
        let rim = 0.06 * (1.0 - n.dot(toward).max(0.0)).powi(3);
        let amount = 0.85 * direct + sky * open * (0.35 + 0.65 * open);
        base.map(|c| (c * amount + shine + rim * open).min(1.0))
    }
}

/// A number in 0..1 from three integers, the same everywhere.
fn hash(x: usize, y: usize, salt: u64) -> f64 {
    let mut v = (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F) ^ salt;
    v = (v ^ (v >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v = (v ^ (v >> 32)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((v ^ (v >> 29)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A point of the unit disc: one cell of a grid for each sample of a pixel, turned by a hash of the pixel.
fn sample_jitter(x: usize, y: usize, n: usize) -> DVec2 {
    let (px, py) = (x / n, y / n);
    let shift = |v: f64, salt| (v + hash(px, py, salt)).fract();
    let u = shift(((x % n) as f64 + hash(x, y, 1)) / n as f64, 2);
    let v = shift(((y % n) as f64 + hash(x, y, 3)) / n as f64, 4);
    let angle = std::f64::consts::TAU * v;
    DVec2::new(libm::cos(angle), libm::sin(angle)) * u.sqrt()
}

/// How strongly a line is drawn at sample `k`: silhouettes and creases.
fn edge_weight(hits: &[Option<Hit>], k: usize, width: usize, reach: usize) -> f64 {
    let here = hits[k].as_ref();
    let mut weight: f64 = 0.0;
    for other in [k - reach, k + reach, k - reach * width, k + reach * width] {
        weight = weight.max(match (here, hits[other].as_ref()) {
            (None, None) => 0.0,
            (Some(a), Some(b)) if a.object == GROUND && b.object == GROUND => 0.0,
            (Some(a), Some(b)) if a.object == b.object => {
                // The step of depth that the surface itself makes between the two samples.
                let off_plane = (b.point - a.point).dot(a.normal).abs().max((b.point - a.point).dot(b.normal).abs());
                if a.face != b.face && a.normal.dot(b.normal) < 0.92 || off_plane > 4e-3 * a.at { 0.75 } else { 0.0 }
            }
            _ => 0.85,
        });
    }
    weight
}

/// Linear light to an 8-bit sRGB value.
fn encode(c: f64) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 };
    (255.0 * s + 0.5) as u8
}

/// `ray` in the frame of `pose`.
fn in_frame(ray: &Ray, pose: &Pose) -> Ray {
    let inverse = pose.inverse();
    Ray { origin: inverse.point(ray.origin), direction: inverse.vector(ray.direction) }
}

/// The spans without the part inside the cut.
fn visible(spans: Vec<Span>, cut: Option<&Cut>, ray: &Ray) -> Vec<Span> {
    let Some(cut) = cut else { return spans };
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for (normal, offset) in cut {
        let (slope, value) = (normal.dot(ray.direction), normal.dot(ray.origin) - offset);
        match slope {
            s if s > 0.0 => from = from.max(-value / s),
            s if s < 0.0 => to = to.min(-value / s),
            _ if value < 0.0 => return spans,
            _ => {}
        }
    }
    if from >= to {
        return spans;
    }
    let edge = |at| super::ray::Crossing { at, face: CUT_FACE, outward: true };
    let mut left = Vec::with_capacity(spans.len() + 1);
    for (enter, leave) in spans {
        if leave.at <= from || enter.at >= to {
            left.push((enter, leave));
            continue;
        }
        if enter.at < from {
            left.push((enter, edge(from)));
        }
        if leave.at > to {
            left.push((edge(to), leave));
        }
    }
    left
}

/// Normal of the cut surface at a point on it.
fn cut_normal(cut: &[(DVec3, f64)], x: DVec3) -> DVec3 {
    let nearest = cut.iter().min_by(|a, b| (a.0.dot(x) - a.1).abs().total_cmp(&(b.0.dot(x) - b.1).abs()));
    nearest.map_or(DVec3::Z, |(n, _)| *n)
}
