//! Objects, rules and resolution.

use crate::abi::{Names, Object, Pose, Rule};
use crate::error::Failure;
use crate::handle::{Session, State, on};
use crate::raw::{flag, given, place, reserved, row, text};
use contactd_proto::Effects;
use contactd_proto::rule::{OutOfTable, RuleNumbers};
use std::ffi::c_char;

/// A moving object of group "default" at the origin. Name and group are copied when it is added.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_object_new(name: *const c_char, model: u32) -> Object {
    Object {
        name,
        group: c"default".as_ptr(),
        model,
        is_static: 0,
        rotates: 1,
        reserved: 0,
        max_speed: f64::INFINITY,
        place: Pose::IDENTITY,
        pose: Pose::IDENTITY,
    }
}

/// The rule of two groups with every other field at its default: continuous, report contact, an overlap is the answer.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_rule_new(a: *const c_char, b: *const c_char) -> Rule {
    Rule {
        between: Names { a, b },
        except: std::ptr::null(),
        except_count: 0,
        effects: RuleNumbers::from(&Effects::DEFAULT),
    }
}

/// Adds an object; `*id` is its id, which stays the same over restarts of the server and is never used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_add_object(session: *mut Session, object: *const Object, id: *mut u32) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's structure and variable (1).
        let (object, id) = unsafe { (given(object, "object")?, place(id, "id")?) };
        reserved(object.reserved, "object.reserved")?;
        // SAFETY: the caller's strings (2).
        let (name, group) = unsafe { (text(object.name, "object.name")?, text(object.group, "object.group")?) };
        let mut spec = contactd_client::Object::new(name, object.model).group(group).max_speed(object.max_speed);
        if flag(object.is_static, "object.is_static")? {
            spec = spec.fixed();
        }
        if !flag(object.rotates, "object.rotates")? {
            spec = spec.without_rotation();
        }
        let spec = spec.place(object.place.checked()?).at(object.pose.checked()?);
        id.write(state.session.add_object(spec)?);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Removes an object; its id is not used again. What it carried is detached before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_remove_object(session: *mut Session, id: u32) -> i32 {
    // SAFETY: the caller's handle (3).
    unsafe { on(session, |state| Ok(state.session.remove_object(id)?)) }
}

/// Replaces the session's rules. The first rule that names a pair decides; a pair that no rule names is off once there are
/// rules; without rules every pair is continuous, report contact. contactd_error_index names the rule that was refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_set_rules(session: *mut Session, rules: *const Rule, count: usize) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's structures (1).
        let rules = unsafe { row(rules, count, "rules")? };
        let rules = rules.iter().enumerate();
        // SAFETY: the caller's structures and strings (1, 2).
        let rules = rules.map(|(i, rule)| unsafe { checked(rule) }.map_err(|e| e.at(i)));
        let rules: Vec<contactd_proto::Rule> = rules.collect::<Result<_, _>>()?;
        Ok(state.session.set_rules(&rules)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// From now on `part` moves with `carrier` as it stands to it (at `options.advance` of the last step), and is not tested against it nor
/// against the `count` objects in `touching`. It has the carrier's frame and gets its records; a record of its own is refused. Refused, too:
/// a part to itself or to what it carries, and names that other objects share with those that are not tested.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_attach(
    session: *mut Session,
    part: u32,
    carrier: u32,
    touching: *const u32,
    count: usize,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's numbers (1).
        let touching = unsafe { row(touching, count, "touching")? };
        Ok(state.session.attach(part, carrier, touching)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The part stays where it is (at `options.advance` of the last step), in the frame that it had of its own, with what is attached to it, and
/// is tested as the rules say. Nothing where it is not attached. `advance` must be left as it is until the next step, here and where a part
/// is attached or its carrier removed: a step that begins elsewhere is misuse.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_detach(session: *mut Session, part: u32) -> i32 {
    // SAFETY: the caller's handle (3).
    unsafe { on(session, |state| Ok(state.session.detach(part)?)) }
}

/// A pair of objects that may meet and is not tested, whatever the rules say; `allowed` 0: it is no longer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_allow(session: *mut Session, a: u32, b: u32, allowed: u32) -> i32 {
    let call = |state: &mut State| {
        let allowed = flag(allowed, "allowed")?;
        Ok(state.session.allow(&[[a, b]], allowed)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Sets the resolution of every pair, a length; 0: each its default (1e-9 of the larger bounding radius).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_set_resolution(session: *mut Session, resolution: f64) -> i32 {
    let resolution = (resolution != 0.0).then_some(resolution);
    // SAFETY: the caller's handle (3).
    unsafe { on(session, |state| Ok(state.session.set_resolution(resolution)?)) }
}

/// A rule.
///
/// # Safety
/// Points 1 and 2 of the contract, for all that the rule points to.
unsafe fn checked(rule: &Rule) -> Result<contactd_proto::Rule, Failure> {
    let pair = |names: &Names, what: &str| {
        // SAFETY: the caller's strings (2).
        let (a, b) = unsafe { (text(names.a, what)?, text(names.b, what)?) };
        Ok([a.to_owned(), b.to_owned()])
    };
    // SAFETY: the caller's structures (1).
    let except = unsafe { row(rule.except, rule.except_count, "rule.except")? };
    let effects = rule.effects.checked().map_err(|e| {
        let OutOfTable { field, largest, found } = e;
        Failure::argument(format!("expected rule.{field} of 0 to {largest}, found {found}"))
    })?;
    Ok(contactd_proto::Rule {
        except: except.iter().map(|names| pair(names, "rule.except")).collect::<Result<_, Failure>>()?,
        ..contactd_proto::Rule::asking(pair(&rule.between, "rule.between")?, effects)
    })
}
