//! `flatten MODEL.scad [name=value …]`: prints the `.csg` that OpenSCAD would write, for the models in `server/models`.

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((file, rest)) = arguments.split_first() else {
        return Err("usage: flatten MODEL.scad [name=value …]".into());
    };
    let source = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
    let mut overrides = Vec::new();
    for pair in rest {
        let (name, value) = pair.split_once('=').ok_or_else(|| format!("expected name=value, found {pair:?}"))?;
        overrides.push((name, value.parse().map_err(|_| format!("expected a number after {name}=, found {value:?}"))?));
    }
    print!("{}", contactd_tests::openscad::flatten(&source, &overrides).map_err(|e| format!("{file}: {e}"))?);
    Ok(())
}
