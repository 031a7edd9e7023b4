//! A flat drawing of a few shapes, written as SVG or as PNG.
//!
//! Both come from the same list in the same pixel coordinates (origin upper left). Text is Noto Sans Mono: PNG takes its
//! rasters, SVG names it, with the advance of the raster given so that both lay out alike. Tables and diagrams therefore
//! can count on `text_width`.
//! Not promised: rotated text, characters beyond Latin-1.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use std::fmt::Write;
use tiny_skia::{FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};

/// An opaque colour with its share of cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    /// Red, green, blue, 8-bit sRGB.
    pub rgb: [u8; 3],
    /// 0 invisible .. 1 opaque.
    pub alpha: f64,
}

impl Color {
    /// Opaque, from `0xRRGGBB`.
    pub const fn hex(v: u32) -> Self {
        Self { rgb: [(v >> 16) as u8, (v >> 8) as u8, v as u8], alpha: 1.0 }
    }

    /// The same with another cover.
    pub const fn alpha(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }
}

/// Dark text and lines.
pub const INK: Color = Color::hex(0x1f2933);
/// Secondary text and rules.
pub const GREY: Color = Color::hex(0x7b8794);
/// The paper.
pub const WHITE: Color = Color::hex(0xffffff);

/// Height of a line of text in pixels: the rasters that exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// 16 pixels.
    Small,
    /// 20 pixels.
    Normal,
    /// 24 pixels.
    Large,
    /// 32 pixels.
    Title,
}

impl Size {
    fn raster(self) -> RasterHeight {
        match self {
            Size::Small => RasterHeight::Size16,
            Size::Normal => RasterHeight::Size20,
            Size::Large => RasterHeight::Size24,
            Size::Title => RasterHeight::Size32,
        }
    }

    /// Height of a line, pixels.
    pub fn height(self) -> f64 {
        self.raster().val() as f64
    }

    /// Width of every character, pixels.
    pub fn advance(self) -> f64 {
        get_raster_width(FontWeight::Regular, self.raster()) as f64
    }
}

/// Width of a line of text, pixels.
pub fn text_width(text: &str, size: Size) -> f64 {
    text.chars().count() as f64 * size.advance()
}

/// Where a text stands relative to its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Anchor {
    Left,
    Middle,
    Right,
}

#[derive(Clone, Debug)]
enum Item {
    /// Closed or open path with optional fill and stroke.
    Path {
        points: Vec<[f64; 2]>,
        closed: bool,
        fill: Option<Color>,
        stroke: Option<(Color, f64)>,
        dash: Option<f64>,
    },
    Circle {
        center: [f64; 2],
        radius: f64,
        fill: Option<Color>,
        stroke: Option<(Color, f64)>,
    },
    Text {
        at: [f64; 2],
        text: String,
        size: Size,
        bold: bool,
        color: Color,
    },
    Image {
        at: [f64; 2],
        width: usize,
        pixels: Vec<[u8; 3]>,
    },
}

/// The drawing.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    items: Vec<Item>,
}

impl Drawing {
    /// White paper.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, items: vec![] }
    }

    /// An image with its upper left corner at `at`; rows from the top.
    pub fn image(&mut self, at: [f64; 2], width: usize, pixels: Vec<[u8; 3]>) {
        self.items.push(Item::Image { at, width, pixels });
    }

    /// A line of the given width.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: Color, width: f64) {
        self.items.push(Item::Path {
            points: vec![from, to],
            closed: false,
            fill: None,
            stroke: Some((color, width)),
            dash: None,
        });
    }

    /// A dashed line, dashes and gaps of the length `dash`.
    pub fn dashed(&mut self, from: [f64; 2], to: [f64; 2], color: Color, width: f64, dash: f64) {
        self.items.push(Item::Path {
            points: vec![from, to],
            closed: false,
            fill: None,
            stroke: Some((color, width)),
            dash: Some(dash),
        });
    }

    /// An open path.
    pub fn path(&mut self, points: Vec<[f64; 2]>, color: Color, width: f64) {
        self.items.push(Item::Path { points, closed: false, fill: None, stroke: Some((color, width)), dash: None });
    }

    /// A filled polygon with an optional outline.
    pub fn polygon(&mut self, points: Vec<[f64; 2]>, fill: Option<Color>, stroke: Option<(Color, f64)>) {
        self.items.push(Item::Path { points, closed: true, fill, stroke, dash: None });
    }

    /// A rectangle by its upper left corner and size.
    pub fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], fill: Option<Color>, stroke: Option<(Color, f64)>) {
        let [x, y] = at;
        let [w, h] = size;
        self.polygon(vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]], fill, stroke);
    }

    /// A circle.
    pub fn circle(&mut self, center: [f64; 2], radius: f64, fill: Option<Color>, stroke: Option<(Color, f64)>) {
        self.items.push(Item::Circle { center, radius, fill, stroke });
    }

    /// A line of text whose middle height is at `at[1]`.
    pub fn text(&mut self, at: [f64; 2], text: &str, size: Size, anchor: Anchor, color: Color) {
        self.styled(at, text, size, anchor, color, false);
    }

    /// The same in bold.
    pub fn bold(&mut self, at: [f64; 2], text: &str, size: Size, anchor: Anchor, color: Color) {
        self.styled(at, text, size, anchor, color, true);
    }

    fn styled(&mut self, at: [f64; 2], text: &str, size: Size, anchor: Anchor, color: Color, bold: bool) {
        let width = text_width(text, size);
        let left = match anchor {
            Anchor::Left => at[0],
            Anchor::Middle => at[0] - 0.5 * width,
            Anchor::Right => at[0] - width,
        };
        self.items.push(Item::Text { at: [left, at[1]], text: text.into(), size, bold, color });
    }

    /// Puts `other` below this drawing.
    pub fn below(mut self, other: Drawing) -> Self {
        let down = self.height as f64;
        let shift = |[x, y]: [f64; 2]| [x, y + down];
        self.width = self.width.max(other.width);
        self.height += other.height;
        self.items.extend(other.items.into_iter().map(|item| match item {
            Item::Path { points, closed, fill, stroke, dash } => {
                Item::Path { points: points.into_iter().map(shift).collect(), closed, fill, stroke, dash }
            }
            Item::Circle { center, radius, fill, stroke } => {
                Item::Circle { center: shift(center), radius, fill, stroke }
            }
            Item::Text { at, text, size, bold, color } => Item::Text { at: shift(at), text, size, bold, color },
            Item::Image { at, width, pixels } => Item::Image { at: shift(at), width, pixels },
        }));
        self
    }

    /// The drawing as an SVG file.
    pub fn to_svg(&self) -> String {
        let (w, h) = (self.width, self.height);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"Noto Sans Mono, DejaVu Sans Mono, Menlo, Consolas, monospace\" stroke-linejoin=\"round\" \
             stroke-linecap=\"round\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        for item in &self.items {
            match item {
                Item::Path { points, closed, fill, stroke, dash } => {
                    out.push_str("<path d=\"");
                    for (i, [x, y]) in points.iter().enumerate() {
                        let _ = write!(out, "{}{} {}", if i == 0 { "M" } else { "L" }, short(*x), short(*y));
                    }
                    out.push_str(if *closed { "Z\"" } else { "\"" });
                    paint(&mut out, *fill, *stroke);
                    if let Some(d) = dash {
                        let _ = write!(out, " stroke-dasharray=\"{0} {0}\"", short(*d));
                    }
                    out.push_str("/>\n");
                }
                Item::Circle { center, radius, fill, stroke } => {
                    let [x, y] = center.map(short);
                    let _ = write!(out, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{}\"", short(*radius));
                    paint(&mut out, *fill, *stroke);
                    out.push_str("/>\n");
                }
                Item::Text { at, text, size, bold, color } => {
                    // Noto Sans Mono advances by 0.6 em; textLength keeps other fonts in place.
                    let em = size.advance() / 0.6;
                    let [x, y] = [at[0], at[1] + 0.36 * em].map(short);
                    let weight = if *bold { " font-weight=\"bold\"" } else { "" };
                    let _ = writeln!(
                        out,
                        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" textLength=\"{}\" xml:space=\"preserve\"{weight} \
                         fill=\"{}\"{}>{}</text>",
                        short(em),
                        short(text_width(text, *size)),
                        css(*color),
                        opacity("fill", *color),
                        escape(text)
                    );
                }
                Item::Image { at, width, pixels } => {
                    let data = base64(&encode_png(*width, pixels));
                    let [x, y] = at.map(short);
                    let (w, h) = (width, pixels.len() / width);
                    let _ = writeln!(
                        out,
                        "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" href=\"data:image/png;base64,{data}\"/>"
                    );
                }
            }
        }
        out.push_str("</svg>\n");
        out
    }

    /// The file's bytes in the format that the ending of `path` names.
    pub fn encode_for(&self, path: &std::path::Path) -> Result<Vec<u8>, String> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("svg") => Ok(self.to_svg().into_bytes()),
            Some("png") => Ok(self.to_png()),
            _ => Err(format!("{}: a picture's name ends in .svg or .png", path.display())),
        }
    }

    /// The drawing as a PNG file, one pixel a unit.
    pub fn to_png(&self) -> Vec<u8> {
        let mut map = Pixmap::new(self.width.max(1) as u32, self.height.max(1) as u32).expect("sizes are positive");
        map.fill(tiny_skia::Color::WHITE);
        for item in &self.items {
            match item {
                Item::Path { points, closed, fill, stroke, dash } => {
                    let mut path = PathBuilder::new();
                    for (i, [x, y]) in points.iter().enumerate() {
                        let (x, y) = (*x as f32, *y as f32);
                        if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
                    }
                    if *closed {
                        path.close();
                    }
                    draw(&mut map, path.finish(), *fill, *stroke, *dash);
                }
                Item::Circle { center, radius, fill, stroke } => {
                    let path = PathBuilder::from_circle(center[0] as f32, center[1] as f32, *radius as f32);
                    draw(&mut map, path, *fill, *stroke, None);
                }
                Item::Text { at, text, size, bold, color } => raster_text(&mut map, *at, text, *size, *bold, *color),
                Item::Image { at, width, pixels } => {
                    for (k, rgb) in pixels.iter().enumerate() {
                        let (x, y) = (k % width + at[0] as usize, k / width + at[1] as usize);
                        blend(&mut map, x, y, Color { rgb: *rgb, alpha: 1.0 });
                    }
                }
            }
        }
        let pixels: Vec<[u8; 3]> = map.pixels().iter().map(|p| [p.red(), p.green(), p.blue()]).collect();
        encode_png(self.width, &pixels)
    }
}

fn draw(
    map: &mut Pixmap,
    path: Option<tiny_skia::Path>,
    fill: Option<Color>,
    stroke: Option<(Color, f64)>,
    dash: Option<f64>,
) {
    let Some(path) = path else { return };
    let paint = |c: Color| {
        let mut p = Paint { anti_alias: true, ..Paint::default() };
        p.set_color_rgba8(c.rgb[0], c.rgb[1], c.rgb[2], (255.0 * c.alpha + 0.5) as u8);
        p
    };
    if let Some(c) = fill {
        map.fill_path(&path, &paint(c), FillRule::Winding, Transform::identity(), None);
    }
    if let Some((c, width)) = stroke {
        let dash = dash.and_then(|d| tiny_skia::StrokeDash::new(vec![d as f32, d as f32], 0.0));
        let stroke = Stroke {
            width: width as f32,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash,
            ..Stroke::default()
        };
        map.stroke_path(&path, &paint(c), &stroke, Transform::identity(), None);
    }
}

fn raster_text(map: &mut Pixmap, at: [f64; 2], text: &str, size: Size, bold: bool, color: Color) {
    let weight = if bold { FontWeight::Bold } else { FontWeight::Regular };
    let top = at[1] - 0.5 * size.height();
    for (i, c) in text.chars().enumerate() {
        let Some(glyph) = get_raster(c, weight, size.raster()).or_else(|| get_raster('?', weight, size.raster()))
        else {
            continue;
        };
        let left = at[0] + i as f64 * size.advance();
        for (y, row) in glyph.rows().enumerate() {
            for (x, cover) in row.iter().enumerate() {
                let (x, y) = (left.round() + x as f64, top.round() + y as f64);
                if *cover > 0 && x >= 0.0 && y >= 0.0 {
                    blend(map, x as usize, y as usize, color.alpha(color.alpha * *cover as f64 / 255.0));
                }
            }
        }
    }
}

fn blend(map: &mut Pixmap, x: usize, y: usize, color: Color) {
    let (w, h) = (map.width() as usize, map.height() as usize);
    if x >= w || y >= h {
        return;
    }
    let p = &mut map.pixels_mut()[y * w + x];
    let mix = |over: u8, under: u8| (over as f64 * color.alpha + under as f64 * (1.0 - color.alpha) + 0.5) as u8;
    let [r, g, b] = color.rgb;
    let (r, g, b) = (mix(r, p.red()), mix(g, p.green()), mix(b, p.blue()));
    *p = tiny_skia::PremultipliedColorU8::from_rgba(r, g, b, 255).expect("an opaque colour is premultiplied");
}

/// A PNG file of 8-bit RGB rows from the top.
pub fn encode_png(width: usize, pixels: &[[u8; 3]]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, (pixels.len() / width.max(1)) as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let bytes: Vec<u8> = pixels.iter().flatten().copied().collect();
    let mut writer = encoder.write_header().expect("writing to memory does not fail");
    writer.write_image_data(&bytes).expect("the rows fill the image");
    drop(writer);
    file
}

/// At most two decimals, without trailing zeros.
fn short(v: f64) -> String {
    let s = format!("{v:.2}");
    let s = s.trim_end_matches('0').trim_end_matches('.');
    if s == "-0" { "0".into() } else { s.into() }
}

fn css(c: Color) -> String {
    format!("#{:02x}{:02x}{:02x}", c.rgb[0], c.rgb[1], c.rgb[2])
}

fn opacity(what: &str, c: Color) -> String {
    if c.alpha < 1.0 { format!(" {what}-opacity=\"{}\"", short(c.alpha)) } else { String::new() }
}

fn paint(out: &mut String, fill: Option<Color>, stroke: Option<(Color, f64)>) {
    match fill {
        Some(c) => {
            let _ = write!(out, " fill=\"{}\"{}", css(c), opacity("fill", c));
        }
        None => out.push_str(" fill=\"none\""),
    }
    if let Some((c, width)) = stroke {
        let _ = write!(out, " stroke=\"{}\" stroke-width=\"{}\"{}", css(c), short(width), opacity("stroke", c));
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |w, b| (w << 8) | *b as u32) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i)) as usize & 63] as char;
            out.push(if i <= chunk.len() { letter } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_vectors_of_rfc_4648() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn a_png_reads_back_as_what_was_drawn() {
        let mut d = Drawing::new(8, 4);
        d.image([0.0, 0.0], 2, vec![[10, 20, 30]; 4]);
        d.rectangle([4.0, 0.0], [4.0, 4.0], Some(Color::hex(0xff0000)), None);
        let file = d.to_png();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let at = |x: usize, y: usize| &pixels[3 * (8 * y + x)..3 * (8 * y + x) + 3];
        assert_eq!((at(1, 1), at(3, 3), at(6, 2)), (&[10, 20, 30][..], &[255, 255, 255][..], &[255, 0, 0][..]));
        assert!(d.to_svg().contains("<image x=\"0\" y=\"0\" width=\"2\" height=\"2\" href=\"data:image/png;base64,"));
    }
}
