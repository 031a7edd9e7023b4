//! Height fields: what an OpenSCAD text's `surface` names, rows of numbers (DAT) or a picture (PNG), and grids of
//! heights.
//!
//! As OpenSCAD 2021.01 builds them: a number is a corner of a square of side 1, rows go up in y (of a picture the lowest is the first);
//! each square has a corner in its middle, as high as its four are in the mean; the solid reaches down to one below the lowest that is
//! told, or to 0 where that is higher. A short row ends in zeros. A picture's heights are its luminance in hundredths of white, or,
//! inverted, that of 1 - 255 times it.

use super::Place;
use super::mesh::Polygons;
use super::problem::Problem;
use super::{Limits, mesh};
use glam::{DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Heights in rows of one length.
struct Heights {
    rows: usize,
    columns: usize,
    all: Vec<f64>,
    /// The lowest that was told.
    lowest: f64,
}

/// The solid between the plane z = `base` and heights above it, given in rows that go up in y, each of `columns` in x,
/// at the corners of equal cells of a rectangle of this size about the origin. Each cell is two triangles that meet
/// along the diagonal from its corner of least x and y to that of most. Two rows of two are needed.
pub fn grid(heights: &[f64], columns: usize, size: DVec2, base: f64) -> Polygons {
    let rows = heights.len() / columns;
    let mut mesh = Polygons::default();
    let along = |k: usize, count: usize, length: f64| (k as f64 / (count - 1) as f64 - 0.5) * length;
    let at =
        |row: usize, column: usize, z: f64| DVec3::new(along(column, columns, size.x), along(row, rows, size.y), z);
    for (row, of_row) in heights.chunks_exact(columns).enumerate() {
        mesh.points.extend(of_row.iter().enumerate().map(|(column, z)| at(row, column, *z)));
    }
    let corner = |row: usize, column: usize| (row * columns + column) as u32;
    for (row, column) in (1..rows).flat_map(|r| (1..columns).map(move |c| (r, c))) {
        let [low, high] = [corner(row - 1, column - 1), corner(row, column)];
        mesh.append(&[low, corner(row - 1, column), high]);
        mesh.append(&[low, high, corner(row, column - 1)]);
    }
    close(&mut mesh, (rows, columns), |row, column| at(row, column, base));
    mesh
}

/// Walls from the rim of a grid, whose points come first in a mesh, down to `below`, and the floor.
fn close(mesh: &mut Polygons, (rows, columns): (usize, usize), below: impl Fn(usize, usize) -> DVec3) {
    let corner = |row: usize, column: usize| (row * columns + column) as u32;
    // Once around, counter-clockwise as seen from above.
    let mut rim: Vec<(usize, usize)> = (0..columns - 1).map(|c| (0, c)).collect();
    rim.extend((0..rows - 1).map(|r| (r, columns - 1)));
    rim.extend((1..columns).rev().map(|c| (rows - 1, c)));
    rim.extend((1..rows).rev().map(|r| (r, 0)));
    let first = mesh.points.len() as u32;
    mesh.points.extend(rim.iter().map(|(r, c)| below(*r, *c)));
    let count = rim.len();
    for (i, (row, column)) in rim.iter().enumerate() {
        let j = (i + 1) % count;
        let next = rim[j];
        mesh.append(&[first + i as u32, first + j as u32, corner(next.0, next.1), corner(*row, *column)]);
    }
    mesh.append(&(first..first + count as u32).rev().collect::<Vec<u32>>());
}

/// The solid under a file's heights; one without a square is empty.
///
/// # Errors
/// What is no number, what is no picture that can be read, and what has too many facets.
pub fn read(bytes: &[u8], (center, invert): (bool, bool), limits: &Limits) -> Result<Polygons> {
    let heights = match bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        true => of_picture(bytes, invert, limits)?,
        false => of_text(bytes, limits)?,
    };
    let Heights { rows, columns, all, lowest } = heights;
    let mut mesh = Polygons::default();
    if rows < 2 || columns < 2 {
        return Ok(mesh);
    }
    let base = (lowest - 1.0).min(0.0);
    let half = |n: usize| if center { (n - 1) as f64 * 0.5 } else { 0.0 };
    let at = |row: f64, column: f64, z: f64| DVec3::new(column - half(columns), row - half(rows), z);
    let height = |row: usize, column: usize| all[row * columns + column];
    for row in 0..rows {
        mesh.points.extend((0..columns).map(|c| at(row as f64, c as f64, height(row, c))));
    }
    let corner = |row: usize, column: usize| (row * columns + column) as u32;
    for (row, column) in (1..rows).flat_map(|r| (1..columns).map(move |c| (r, c))) {
        let ring = [(row - 1, column - 1), (row - 1, column), (row, column), (row, column - 1)];
        let mean = ring.iter().map(|(r, c)| height(*r, *c)).sum::<f64>() / 4.0;
        let middle = mesh.points.len() as u32;
        mesh.points.push(at(row as f64 - 0.5, column as f64 - 0.5, mean));
        for i in 0..4 {
            let [a, b] = [ring[i], ring[(i + 1) % 4]];
            mesh.append(&[corner(a.0, a.1), corner(b.0, b.1), middle]);
        }
    }
    close(&mut mesh, (rows, columns), |row, column| at(row as f64, column as f64, base));
    Ok(mesh)
}

/// Is there room for so many heights?
fn affordable(rows: usize, columns: usize, limits: &Limits) -> Result<()> {
    // Four triangles a square.
    if rows.saturating_mul(columns).saturating_mul(4) > limits.mesh_facets {
        let what = "triangles of a mesh: four for each square of a surface";
        return Err((Place::START, Problem::Limit { what, limit: limits.mesh_facets }));
    }
    Ok(())
}

fn of_text(bytes: &[u8], limits: &Limits) -> Result<Heights> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let (mut columns, mut count) = (0, 0);
    for line in mesh::lines(bytes)? {
        let mut row = Vec::new();
        for word in line.words() {
            row.push(line.number(Some(word))?);
        }
        columns = columns.max(row.len());
        count += row.len();
        affordable(1, count, limits)?;
        rows.push(row);
        affordable(rows.len(), columns, limits)?;
    }
    let lowest = rows.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let all = rows.iter().flat_map(|r| (0..columns).map(|c| r.get(c).copied().unwrap_or(0.0))).collect();
    Ok(Heights { rows: rows.len(), columns, all, lowest })
}

fn of_picture(bytes: &[u8], invert: bool, limits: &Limits) -> Result<Heights> {
    let broken = |e: png::DecodingError| (Place::START, Problem::syntax("a PNG picture", e.to_string()));
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(bytes), png::Limits { bytes: limits.bytes });
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(broken)?;
    let (width, rows) = (reader.info().width as usize, reader.info().height as usize);
    affordable(rows, width, limits)?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let frame = reader.next_frame(&mut pixels).map_err(broken)?;
    let samples = frame.color_type.samples();
    let mut all = Vec::with_capacity(rows * width);
    // The lowest row of the picture is the first one.
    for row in (0..rows).rev() {
        for column in 0..width {
            let at = row * frame.line_size + column * samples;
            let pixel = pixels.get(at..at + samples).unwrap_or(&[0, 0, 0, 0]);
            let [r, g, b] = if samples < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] }.map(f64::from);
            let light = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            all.push(100.0 / 255.0 * if invert { 1.0 - light } else { light });
        }
    }
    let lowest = all.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(Heights { rows, columns: width, all, lowest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::primitive::TriangleMesh;
    use crate::solid::{Label, SolidBuilder};

    /// Height of the surface above a point: of the four triangles of its square the one that it is over.
    fn height(at: &dyn Fn(usize, usize) -> f64, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor() as usize, y.floor() as usize);
        let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
        let (u, v) = (x.fract() - 0.5, y.fract() - 0.5);
        let middle = (a + b + c + d) / 4.0;
        // The side that the point is next to, its ends, and how far along it lies.
        let (from, to, out, along) = match u.abs() > v.abs() {
            true if u > 0.0 => (b, c, u, v),
            true => (a, d, -u, v),
            false if v > 0.0 => (d, c, v, u),
            false => (a, b, -v, u),
        };
        middle + ((from + to) / 2.0 - middle) * (out / 0.5) + (to - from) * along
    }

    fn check(
        bytes: &[u8],
        center: bool,
        invert: bool,
        (rows, columns): (usize, usize),
        at: &dyn Fn(usize, usize) -> f64,
    ) {
        let mesh = read(bytes, (center, invert), &Limits::default()).expect("a surface");
        let (shape, _) = TriangleMesh::of_polygons(&mesh.points, mesh.faces()).expect("closed");
        let mut builder = SolidBuilder::new();
        let label = Label { name: "surface".into(), line: 1, column: 1, mirrored: false };
        let root = builder.primitive(shape, contactd_proto::Pose::IDENTITY, label);
        let solid = builder.finish(root);
        let all = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c)));
        let base = all.fold(0.0, |m: f64, (r, c)| m.min(at(r, c) - 1.0));
        let mut r = Random(3);
        let shift = if center { DVec3::new((columns - 1) as f64, (rows - 1) as f64, 0.0) * 0.5 } else { DVec3::ZERO };
        let (mut full, mut seen) = (0, 0);
        for _ in 0..400 {
            let (x, y) = (r.unit() * (columns - 1) as f64, r.unit() * (rows - 1) as f64);
            let top = height(at, x, y);
            let z = r.within(base - 1.0, top.max(base) + (top - base).abs().max(1.0));
            if (z - top).abs() < 1e-9 || (z - base).abs() < 1e-9 {
                continue;
            }
            let p = DVec3::new(x, y, z) - shift;
            let inside = (base..top).contains(&z);
            assert_eq!(solid.value(p) < 0.0, inside, "{p}");
            (full, seen) = (full + usize::from(inside), seen + 1);
        }
        assert!(full > seen / 5, "{full} of {seen}");
    }

    #[test]
    fn surfaces_hold_what_lies_between_their_heights_and_their_base() {
        let mut r = Random(9);
        for round in 0..6 {
            let (rows, columns) = (2 + round, 7 - round);
            let heights: Vec<f64> = (0..rows * columns).map(|_| (r.within(-3.0, 9.0) * 8.0).round() / 8.0).collect();
            let row = |i: usize| {
                heights[i * columns..(i + 1) * columns].iter().map(|h| format!("{h}\t ")).collect::<String>()
            };
            let text: String = (0..rows).map(|i| format!("# row {i}\n{}\n\n", row(i))).collect();
            check(text.as_bytes(), round % 2 == 0, false, (rows, columns), &|i, j| heights[i * columns + j]);
            let mut png = Vec::new();
            let mut encoder = png::Encoder::new(&mut png, columns as u32, rows as u32);
            let (color, samples) = [(png::ColorType::Grayscale, 1), (png::ColorType::Rgb, 3)][round % 2];
            encoder.set_color(color);
            let pixels: Vec<u8> = (0..rows * columns * samples).map(|_| r.within(0.0, 255.9) as u8).collect();
            encoder.write_header().and_then(|mut w| w.write_image_data(&pixels)).expect("written");
            let invert = round > 2;
            let light = |i: usize, j: usize| {
                let at = ((rows - 1 - i) * columns + j) * samples;
                let [r, g, b] = [0, samples / 2, samples - 1].map(|k| f64::from(pixels[at + k]));
                let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
                if invert { (1.0 - y) / 2.55 } else { y / 2.55 }
            };
            check(&png, round % 2 == 1, invert, (rows, columns), &light);
        }
    }

    /// As OpenSCAD 2021.01 exports it.
    #[test]
    fn what_a_short_row_lacks_does_not_lower_the_base() {
        let base = |text: &str| {
            let mesh = read(text.as_bytes(), (false, false), &Limits::default()).expect("a surface");
            mesh.points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min)
        };
        assert_eq!(base("1 2 3 4\n4 5\n7 8 10\n"), 0.0);
        assert_eq!((base("1 2\n0.5 3\n"), base("1 2\n-3 3\n"), base("5 2\n3 3\n")), (-0.5, -4.0, 0.0));
    }

    #[test]
    fn what_is_no_surface_is_refused_and_one_without_a_square_is_empty() {
        let of = |bytes: &[u8]| read(bytes, (false, false), &Limits { mesh_facets: 100, ..Limits::default() });
        for flat in ["", "# none", "1 2 3", "1\n2\n3"] {
            assert!(of(flat.as_bytes()).expect("empty").is_empty(), "{flat}");
        }
        let (at, problem) = of(b"1 2\n3 x4\n").expect_err("no number");
        assert_eq!(format!("{at}: {problem}"), "2:3: expected a finite number, found \"x4\"");
        let (_, problem) = of("1 2 3 4 5 6\n".repeat(5).as_bytes()).expect_err("too many");
        assert!(
            problem.to_string().starts_with("expected at most 100 triangles of a mesh: four for each"),
            "{problem}"
        );
        let (_, problem) = of(b"\x89PNG\r\n\x1a\nnone").expect_err("no picture");
        assert!(problem.to_string().starts_with("expected a PNG picture, found "), "{problem}");
    }
}
