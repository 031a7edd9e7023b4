//! Flattened OpenSCAD texts as other formats' readers write them.

use contactd_proto::Pose;

/// A text that stands somewhere; `{:?}` of a double is the shortest text that reads back to the same bits.
pub(super) fn placed(pose: &Pose, text: &str) -> String {
    if *pose == Pose::IDENTITY {
        return text.to_owned();
    }
    let axes = pose.matrix();
    let row = |k: usize| {
        let [x, y, z] = [axes.x_axis[k], axes.y_axis[k], axes.z_axis[k]];
        format!("[{x:?}, {y:?}, {z:?}, {:?}]", pose.position[k])
    };
    format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{ {text} }}", row(0), row(1), row(2))
}
