//! Contacts drawn into a view: a dot at the point, an arrow along the normal, a number, and a legend below.
//!
//! A contact that lies behind material is drawn with a hollow dot and a dashed arrow. Numbers push each other apart, so
//! that near contacts stay readable; a thin line leads each back to its arrow.

use super::drawing::{Anchor, Color, Drawing, GREY, INK, Size, WHITE, text_width};
use super::view::View;
use glam::{DVec2, DVec3};

/// One contact of a picture.
#[derive(Clone, Debug)]
pub struct Mark {
    /// Where it is, world.
    pub point: DVec3,
    /// Unit normal, world.
    pub normal: DVec3,
    /// Its line in the legend.
    pub text: String,
}

const MARK: Color = Color::hex(0xd6281e);
const ARROW: f64 = 52.0;
const BADGE: f64 = 12.0;

/// Renders `view` with `title` above and `marks` drawn in and listed below; `note` is a last grey line.
pub fn annotated(view: &View, title: &str, marks: &[Mark], note: &str) -> Drawing {
    let (width, height) = view.camera.size;
    let head = if title.is_empty() { 0.0 } else { 56.0 };
    let row = 24.0;
    let widest = marks.iter().map(|m| text_width(&m.text, Size::Normal)).fold(1.0, f64::max) + 60.0;
    let columns = ((width as f64 - 40.0) / widest).floor().max(1.0) as usize;
    let rows = marks.len().div_ceil(columns);
    let legend = rows as f64 * row + if note.is_empty() { 16.0 } else { 46.0 };
    let mut d = Drawing::new(width, (head + height as f64 + legend) as usize);
    d.image([0.0, head], width, view.render());
    if !title.is_empty() {
        d.bold([24.0, 32.0], title, Size::Large, Anchor::Left, INK);
    }
    draw_marks(&mut d, view, marks, DVec2::new(0.0, head));
    for (i, mark) in marks.iter().enumerate() {
        let x = 36.0 + (i / rows.max(1)) as f64 * widest;
        let y = head + height as f64 + 12.0 + (i % rows.max(1)) as f64 * row;
        badge(&mut d, [x, y], i + 1);
        d.text([x + 24.0, y], &mark.text, Size::Normal, Anchor::Left, INK);
    }
    if !note.is_empty() {
        let y = d.height as f64 - 18.0;
        d.text([24.0, y], note, Size::Small, Anchor::Left, GREY);
    }
    d
}

fn badge(d: &mut Drawing, at: [f64; 2], number: usize) {
    d.circle(at, BADGE, Some(MARK), Some((WHITE, 2.0)));
    d.bold(at, &number.to_string(), Size::Small, Anchor::Middle, WHITE);
}

fn draw_marks(d: &mut Drawing, view: &View, marks: &[Mark], shift: DVec2) {
    let mut at = Vec::new();
    for mark in marks {
        let from = view.camera.pixel(mark.point) + shift;
        let ahead = mark.point + mark.normal * (ARROW * view.camera.pixel_length(mark.point));
        let to = view.camera.pixel(ahead) + shift;
        let direction = (to - from).try_normalize().unwrap_or(DVec2::new(0.6, -0.8));
        // Numbers stand beyond the tip; arrows that point at the viewer are short, their number goes up and right.
        let side = if (to - from).length() < 0.3 * ARROW { DVec2::new(0.6, -0.8) } else { direction };
        at.push((from, to, direction, to + side * (BADGE + 8.0)));
    }
    for _ in 0..200 {
        for i in 0..at.len() {
            for j in 0..at.len() {
                let apart = at[i].3 - at[j].3;
                let need = 2.0 * BADGE + 6.0;
                if i != j && apart.length() < need {
                    let way = apart.try_normalize().unwrap_or(DVec2::new(1.0, i as f64 - j as f64).normalize());
                    at[i].3 += way * (0.3 * (need - apart.length()) + 0.1);
                }
                // And keep off the other contacts' points.
                let apart = at[i].3 - at[j].0;
                if apart.length() < BADGE + 8.0 {
                    at[i].3 += apart.try_normalize().unwrap_or(DVec2::Y) * 2.0;
                }
            }
            let edge = DVec2::splat(BADGE + 4.0);
            at[i].3 = at[i].3.clamp(edge, DVec2::new(d.width as f64, d.height as f64) - edge);
        }
    }
    for (i, mark) in marks.iter().enumerate() {
        let (from, to, direction, label) = at[i];
        let seen = view.sees(mark.point);
        let (f, t) = (from.to_array(), to.to_array());
        if (label - to).length() > BADGE + 12.0 {
            d.line(t, label.to_array(), GREY, 1.0);
        }
        if seen {
            d.line(f, t, WHITE.alpha(0.8), 6.0);
            d.line(f, t, MARK, 3.0);
        } else {
            d.line(f, t, WHITE.alpha(0.6), 5.0);
            d.dashed(f, t, MARK, 2.5, 6.0);
        }
        if (to - from).length() > 12.0 {
            let across = direction.perp() * 5.0;
            let base = to - direction * 12.0;
            d.polygon(vec![t, (base + across).to_array(), (base - across).to_array()], Some(MARK), None);
        }
        d.circle(f, 5.5, Some(if seen { MARK } else { WHITE }), Some((if seen { WHITE } else { MARK }, 2.0)));
    }
    for (i, (_, _, _, label)) in at.iter().enumerate() {
        badge(d, label.to_array(), i + 1);
    }
}
