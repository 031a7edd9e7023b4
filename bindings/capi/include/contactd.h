// contactd: earliest contact of moving solids modelled by constructive solid geometry, from C and C++.
//
// Lengths are in the models' unit, times within a step a fraction 0..1, axes right-handed, quaternions x y z w, angles in
// radians. Every function that can fail returns CONTACTD_OK or another code; contactd_error_message() says what was wrong.
// A session belongs to the thread that opened it.
//
// Converters (contactd_from_…, contactd_to_…, contactd_contact_…) take and give arrays: `position`, `point`, `normal` and other
// vectors of 3 numbers, `rotation` of 4, as they are in contactd_pose_record and contactd_record. What goes in is read before
// anything is written. In an engine's contact its body 1 (A, first) is a.
//
// Not to be edited: made of the Rust sources by bindings/capi/tests/header.rs.

#ifndef CONTACTD_H
#define CONTACTD_H

#include <stddef.h>
#include <stdint.h>

#define CONTACTD_VERSION "0.1.0"
#define CONTACTD_PROTOCOL_VERSION 3

// Why the server refused: numbers that never change, each with its sentence.

// the server speaks another version of the protocol.
#define CONTACTD_ERROR_VERSION 1

// the session does not exist on this server (any more).
#define CONTACTD_ERROR_SESSION_GONE 2

// there is no object of this id in the session.
#define CONTACTD_ERROR_UNKNOWN_OBJECT 3

// the object is named twice.
#define CONTACTD_ERROR_DUPLICATE_OBJECT 4

// the object is static and cannot be moved.
#define CONTACTD_ERROR_STATIC_OBJECT 5

// a position or rotation is not a finite number, or is farther than 1e150 away.
#define CONTACTD_ERROR_NOT_FINITE 6

// the quaternion is not of unit length (its squared norm is off by more than 0.001).
#define CONTACTD_ERROR_BAD_QUATERNION 7

// the batch is malformed: its record count or its flags are not of the protocol.
#define CONTACTD_ERROR_BAD_COUNT 8

// the batch has more records than the server's limit.
#define CONTACTD_ERROR_TOO_MANY 9

// the motion breaks what was declared of the object (no rotation, or a largest speed).
#define CONTACTD_ERROR_DECLARATION 10

// the resolution is not a positive length well below the smallest dimension of the primitives.
#define CONTACTD_ERROR_RESOLUTION 11

// the model's text is longer than the server's limit.
#define CONTACTD_ERROR_LIMIT_TEXT 12

// the model's tree has more nodes than the server's limit.
#define CONTACTD_ERROR_LIMIT_NODES 13

// the model's tree is deeper than the server's limit.
#define CONTACTD_ERROR_LIMIT_DEPTH 14

// the model has more faces than the server's limit.
#define CONTACTD_ERROR_LIMIT_FACES 15

// the session has as many objects as the server allows.
#define CONTACTD_ERROR_LIMIT_OBJECTS 16

// the server has as many sessions as it allows.
#define CONTACTD_ERROR_LIMIT_SESSIONS 17

// the request needs more memory than the server's limit.
#define CONTACTD_ERROR_LIMIT_MEMORY 18

// the server is busy with an earlier request of this session.
#define CONTACTD_ERROR_BUSY 19

// the server failed internally.
#define CONTACTD_ERROR_INTERNAL 20

// there is no model of this id in the session.
#define CONTACTD_ERROR_UNKNOWN_MODEL 21

// the model cannot be imported.
#define CONTACTD_ERROR_MODEL 22

// the rule is not valid.
#define CONTACTD_ERROR_BAD_RULE 23

// the command cannot be decoded.
#define CONTACTD_ERROR_BAD_COMMAND 24

// an option of the request is out of its range.
#define CONTACTD_ERROR_BAD_NUMBER 25

// the model reaches to infinity.
#define CONTACTD_ERROR_UNBOUNDED 26

// the session was ended on its server, with `contactd sessions end`.
#define CONTACTD_ERROR_SESSION_ENDED 27

// what was asked cannot be recorded or saved.
#define CONTACTD_ERROR_RECORDING 28

// Done.
#define CONTACTD_OK 0

// No server of this name is running.
#define CONTACTD_ERROR_NO_SERVER 1001

// The server died or was stopped, or the session on it was lost: contactd_reconnect finds a server and replays the session.
#define CONTACTD_ERROR_SERVER_LOST 1002

// The server could not deliver its reply; what was asked was done, or refused: contactd_reconnect goes back to before it,
// then it is to be sent again (contactd_resend, for a step).
#define CONTACTD_ERROR_REPLY_LOST 1003

// The time ran out. A step stays in flight: contactd_finish may be called again.
#define CONTACTD_ERROR_TIMEOUT 1004

// The server's name or the runtime folder is not usable.
#define CONTACTD_ERROR_ADDRESS 1005

// Calls came in an order that makes no sense, from another thread, or from within a call.
#define CONTACTD_ERROR_MISUSE 1006

// The system or the shared memory layer failed.
#define CONTACTD_ERROR_SYSTEM 1007

// A pointer is NULL that must not be.
#define CONTACTD_ERROR_NULL 1008

// An argument is out of its range, a string not UTF-8, a pointer not aligned.
#define CONTACTD_ERROR_ARGUMENT 1009

// The settings of an embedded engine cannot be read.
#define CONTACTD_ERROR_CONFIG 1010

// contactd itself failed within this session. Nothing but contactd_close works on it any more.
#define CONTACTD_ERROR_PANIC 1011

// Position and rotation are the pose at the end of the step, reached the shortest way.
#define CONTACTD_END 1

// Position is where the origin ends, rotation[0..3] the rotation vector over the step (world axes, radians).
#define CONTACTD_TURN 2

// The pose is set before the step starts, without motion. May stand beside an END or TURN of the same object.
#define CONTACTD_START 4



// `status`: the surfaces meet within the step.
#define CONTACTD_CONTACT 1

// `status`: they don't.
#define CONTACTD_CLEAR 2

// `status`: deeper than twice the resolution at the start already.
#define CONTACTD_OVERLAP 3

// `status`: the work limit ran out; `time_lower` is proven.
#define CONTACTD_UNDECIDED 4

// `flags`: separation at the start within the touching threshold.
#define CONTACTD_TOUCHING 1

// `flags`: the time could not be continued back from its witness and equals the upper end of its bracket.
#define CONTACTD_NOT_CONTINUED 2

// `flags`: a vertex met a vertex, the normal is an average.
#define CONTACTD_AVERAGED_NORMAL 4

// `flags`: a sensor pair, which never stops a search for the scene's first contact.
#define CONTACTD_SENSOR 8

// `flags`: the work limit cut the search for contact regions: there may be more, and CONTACTD_TOUCHING may be a mere caution.
#define CONTACTD_REGIONS_INCOMPLETE 16

// `flags`: clear, but within its margin at the start or during the step; the detail slot says until when it is proven not to. With
// CONTACTD_REGIONS_INCOMPLETE: it may do so.
#define CONTACTD_WITHIN_MARGIN 32

// `flags`: the answer speaks of a resolution coarser than the pair's own: rounding or the length of its search left nothing
// to prove at that. Which one is in the detail slot.
#define CONTACTD_COARSER_RESOLUTION 64

// `valid`: time and time_lower.
#define CONTACTD_VALID_TIME 1

// `valid`: point.
#define CONTACTD_VALID_POINT 2

// `valid`: normal.
#define CONTACTD_VALID_NORMAL 4

// `valid`: separation.
#define CONTACTD_VALID_SEPARATION 8

// `valid`: normal_speed.
#define CONTACTD_VALID_NORMAL_SPEED 16

// `valid`: kind and extent.
#define CONTACTD_VALID_KIND 32

// `valid`: faces_a and faces_b.
#define CONTACTD_VALID_FACES 64

// "No face" in `faces_a` and `faces_b`.
#define CONTACTD_NO_FACE UINT32_MAX

// First word of a contactd_detail_slot.
#define CONTACTD_DETAIL_SLOT 1

// First word of a contactd_patch_slot.
#define CONTACTD_PATCH_SLOT 2

// First word of a contactd_region_slot.
#define CONTACTD_REGION_SLOT 3

// First word of a contactd_clearance_slot.
#define CONTACTD_CLEARANCE_SLOT 4

// `flags` of a contactd_clearance_slot: the bounds are as near to each other as was asked, or as rounding lets them be.
#define CONTACTD_CLEARANCE_SETTLED 1

// `flags` of a contactd_clearance_slot: points were found; without it they are zero.
#define CONTACTD_CLEARANCE_POINTS 2

// Outcome of a step's search over all its pairs: nothing met.
#define CONTACTD_STEP_CLEAR 1

// Some pair meets or overlaps.
#define CONTACTD_STEP_CONTACT 2

// A pair was left undecided before the earliest contact.
#define CONTACTD_STEP_UNDECIDED 3

// "No record in particular" in `index`.
#define CONTACTD_NO_INDEX UINT32_MAX

// Parts that a point, and stretches that a ray may cost by default.
#define CONTACTD_DEFAULT_QUERY_LIMIT 200000

// "No object" in a contactd_point_record or contactd_ray_record.
#define CONTACTD_NO_OBJECT UINT32_MAX

// `outcome` of a contactd_ray_record: it crosses a surface.
#define CONTACTD_RAY_HIT 0

// `outcome` of a contactd_ray_record: proven that it crosses none.
#define CONTACTD_RAY_MISS 1

// `outcome` of a contactd_ray_record: the limit of work was met, or it comes from too far away to tell.
#define CONTACTD_RAY_UNDECIDED 2

// `effects`: pairs searched over the whole step.
#define CONTACTD_EFFECT_CONTINUOUS 1

// `effects`: pairs tested at the end of the step only.
#define CONTACTD_EFFECT_DISCRETE 2

// `effects`: of the pairs searched over the step those of which a body turns: their bounds are those of rotation.
#define CONTACTD_EFFECT_TURNING 4

// `effects`: times of contact worked out: continued from the witness back to where the surfaces meet.
#define CONTACTD_EFFECT_TIME 8

// `effects`: contact points with their normal, kind and faces.
#define CONTACTD_EFFECT_CONTACT 16

// `effects`: pairs whose contact regions were looked for.
#define CONTACTD_EFFECT_PATCH 32

// `effects`: deepest points of overlaps at the start.
#define CONTACTD_EFFECT_PENETRATION 64

// `effects`: separations tested against a margin.
#define CONTACTD_EFFECT_MARGIN 128

// `effects`: overlaps at the start that were searched past.
#define CONTACTD_EFFECT_PAST_OVERLAP 256

// `effects`: sensor pairs told.
#define CONTACTD_EFFECT_SENSOR 512

// `effects`: least distances over the step worked out.
#define CONTACTD_EFFECT_CLEARANCE 1024

// Not at all.
#define CONTACTD_DETECT_OFF 0

// The end pose only.
#define CONTACTD_DETECT_DISCRETE 1

// The whole motion.
#define CONTACTD_DETECT_CONTINUOUS 2

// Yes or no.
#define CONTACTD_REPORT_HIT 0

// The time too.
#define CONTACTD_REPORT_TIME 1

// Point, normal and kind too.
#define CONTACTD_REPORT_CONTACT 2

// The points of all contact regions too.
#define CONTACTD_REPORT_PATCH 3

// The overlap is the answer.
#define CONTACTD_INITIAL_OVERLAP_REPORT 0

// The search goes on for the starting depth + the resolution.
#define CONTACTD_INITIAL_OVERLAP_IGNORE_IF_SEPARATING 1

// Curved primitives are exact when `$fn` is 0 or at least 9, as written below that.
#define CONTACTD_FACETS_AUTO 0

// Always exact.
#define CONTACTD_FACETS_EXACT 1

// Always the prism or polyhedron that `$fn` asks for.
#define CONTACTD_FACETS_AS_WRITTEN 2

// All points of any of the operands.
#define CONTACTD_UNION 0

// All points that the operands have in common.
#define CONTACTD_INTERSECTION 1

// All points of the first operand that no other one has.
#define CONTACTD_DIFFERENCE 2

// The convex hull of the operands.
#define CONTACTD_HULL 3

// All sums of a point of each operand; of solids alone.
#define CONTACTD_MINKOWSKI 4

// Corners that an offset opens are joined by a circle.
#define CONTACTD_CORNERS_ROUND 0

// By prolonging the sides.
#define CONTACTD_CORNERS_SHARP 1

// By a straight cut.
#define CONTACTD_CORNERS_CUT 2

// A solid in the making, and its text once that was asked for.
typedef struct contactd_solid contactd_solid;

// A flat shape in the making.
typedef struct contactd_outline contactd_outline;

// A scene that was loaded into a session. It belongs to no thread, but is in one call at a time.
typedef struct contactd_scene contactd_scene;

// The points of all pairs, from step to step.
typedef struct contactd_manifolds contactd_manifolds;

// One client's scene on a server, or in this process. It belongs to the thread that opened it.
typedef struct contactd_session contactd_session;

// What the server said when it opened the session.
typedef struct contactd_opened {
    // Session id.
    uint64_t session;
    // Epoch of the server; changes with its every start.
    uint64_t epoch;
    // Most records in a batch.
    uint32_t max_batch;
    // Zero.
    uint32_t reserved;
} contactd_opened;

// A face of a model. Its strings are valid until the session is closed.
typedef struct contactd_face {
    // Index of its primitive in file order.
    uint32_t primitive;
    // 1: the primitive is subtracted.
    uint32_t subtracted;
    // The primitive's name in the format: "sphere", "cylinder" …
    const char *name;
    // The face's name: "side", "top" …
    const char *face;
} contactd_face;

// Volume, centre of mass and inertia of a solid of even density. Every true value lies within its error of the one given.
typedef struct contactd_mass {
    // Volume, length³.
    double volume;
    // Bound of its error, length³.
    double volume_error;
    // Centre of mass.
    double center[3];
    // Bounds of its error, a length along each axis.
    double center_error[3];
    // Mass per volume; 1 unless contactd_mass_with_density changed it.
    double density;
    // Inertia tensor about the centre of mass: xx, yy, zz, xy, xz, yz (xx = ∫ y² + z² dm, xy = −∫ x y dm), density · length⁵.
    double inertia[6];
    // Bounds of its error, in the same order and unit.
    double inertia_error[6];
    // Boxes that were looked at; 0 where a closed formula answers.
    uint64_t boxes;
} contactd_mass;

// A rigid placement: `parent = rotation * local + position`.
typedef struct contactd_pose {
    // Position x, y, z.
    double position[3];
    // Unit quaternion x, y, z, w.
    double rotation[4];
} contactd_pose;

// An object to be added: a model, where it stands, and what is declared of it. contactd_object_new sets the defaults.
typedef struct contactd_object {
    // Its name, for the exceptions of rules.
    const char *name;
    // Its group, for rules.
    const char *group;
    // Its model's id.
    uint32_t model;
    // 1: it never moves.
    uint32_t is_static;
    // 0: it never turns; a motion that turns it will be refused.
    uint32_t rotates;
    // Zero.
    uint32_t reserved;
    // No point of it is ever faster than this, length per second; steps then need `dt`. Infinite: nothing is declared.
    double max_speed;
    // Where the model sits in the object's frame.
    struct contactd_pose place;
    // Where the object stands.
    struct contactd_pose pose;
} contactd_object;

// Two names.
typedef struct contactd_names {
    // The first one.
    const char *a;
    // The second one.
    const char *b;
} contactd_names;

// What happens between two groups of objects. contactd_rule_new sets the defaults.
typedef struct contactd_rule {
    // The two groups; both may be the same.
    struct contactd_names between;
    // Single pairs, by object name, that this rule leaves out; NULL when there are none.
    const struct contactd_names *except;
    // Number of them.
    size_t except_count;
    // Report at this separation too (length, >= 0): measured by f, never late, early at sharp features.
    double margin;
    // Tell the least distance over the step, its bounds no farther apart than this (length); 0: not asked.
    double clearance;
    // CONTACTD_DETECT_…: how the pair is searched.
    uint32_t detect;
    // CONTACTD_REPORT_…: what is told of it.
    uint32_t report;
    // CONTACTD_INITIAL_OVERLAP_…: what a pair that starts in overlap does.
    uint32_t initial_overlap;
    // 1: depth and direction where a step starts in overlap; with patches, too, by which faces the bodies are in each other.
    uint32_t penetration;
    // 1: record only; never stops a search for the scene's first contact.
    uint32_t sensor;
} contactd_rule;

// A value of a joint.
typedef struct contactd_joint_value {
    // The joint's name.
    const char *name;
    // Radians of what turns, metres of what slides.
    double value;
} contactd_joint_value;

// How a scene is loaded. contactd_scene_options_new sets the defaults.
typedef struct contactd_scene_options {
    // Where a robot's joints stand; of others what the file says. NULL for none.
    const struct contactd_joint_value *joints;
    // Number of them.
    size_t joint_count;
    // The keyframe that joints begin at, of MJCF; NULL for none.
    const char *key;
    // Folders in which packages are looked for (package://NAME/…, model://NAME/…), before the file's own and those above it.
    const char *const *packages;
    // Number of them.
    size_t package_count;
    // An SRDF file with pairs that are not to be tested; NULL for none.
    const char *srdf;
    // The folder that texts may import files from; NULL: each from its own.
    const char *import_root;
    // 1: meshes are taken as their convex hulls, as MuJoCo does anyway.
    uint32_t hulls;
    // 1: the session's rules and resolution stay as they are.
    uint32_t keeps_rules;
} contactd_scene_options;

// What a loaded scene has in it. Strings are valid until the scene is freed.
typedef struct contactd_scene_info {
    // The unit of length; may be empty.
    const char *unit;
    // Duration of the step in seconds that a scene file says; 0 for none.
    double dt;
    // Number of its objects.
    size_t object_count;
    // Number of its joints that have values of their own.
    size_t joint_count;
    // Number of its notes.
    size_t note_count;
} contactd_scene_info;

// An object of a loaded scene.
typedef struct contactd_scene_object {
    // Its name, valid until the scene is freed.
    const char *name;
    // Its id in the session.
    uint32_t object;
    // The id of its model.
    uint32_t model;
} contactd_scene_object;

// A joint of a robot that has a value of its own.
typedef struct contactd_joint {
    // Its name, valid until the scene is freed.
    const char *name;
    // 1: it turns, and its value is an angle in radians; 0: it slides, metres.
    uint32_t turns;
    // Zero.
    uint32_t reserved;
    // Its lower limit; infinite where it has none.
    double low;
    // Its upper limit.
    double high;
    // Where it stands.
    double value;
} contactd_joint;

// Counted work of a step. Never part of the bits that must agree between two ways to the same answer.
typedef struct contactd_work_counters {
    // Pairs of boxes that the broad phase compared.
    uint64_t box_tests;
    // Primitives of both trees before stage 1, summed over the pairs.
    uint64_t primitives;
    // Primitives left after stage 1.
    uint64_t after_stage1;
    // Pairs of octree nodes visited.
    uint64_t node_pairs;
    // Candidate primitive pairs handed to stage 3.
    uint64_t candidates;
    // Cells refined.
    uint64_t cells;
    // Clauses bounded.
    uint64_t clauses;
    // Newton attempts.
    uint64_t newton;
    // Closed forms used.
    uint64_t closed_forms;
    // Discrete tests of pairs that moved far enough to have passed through each other.
    uint64_t may_have_passed;
    // Cells' worth of work on one instant of a pair: whether it touches, its contact regions, its deepest point.
    uint64_t instant_cells;
} contactd_work_counters;

// How often each effect was worked out in a step. What an earlier step has proven need not be worked out again, so
// counters are no part of the answer's bits.
typedef struct contactd_effect_counters {
    // Pairs searched over the whole step.
    uint64_t continuous;
    // Pairs tested at the end of the step only.
    uint64_t discrete;
    // Of the pairs searched over the step those of which a body turns: their bounds are those of rotation.
    uint64_t turning;
    // Times of contact worked out: continued from the witness back to where the surfaces meet.
    uint64_t times;
    // Contact points with their normal, kind and faces.
    uint64_t contacts;
    // Pairs whose contact regions were looked for.
    uint64_t patches;
    // Deepest points of overlaps at the start.
    uint64_t penetrations;
    // Separations tested against a margin.
    uint64_t margins;
    // Overlaps at the start that were searched past.
    uint64_t past_overlaps;
    // Sensor pairs told.
    uint64_t sensors;
    // Least distances over the step worked out.
    uint64_t clearances;
} contactd_effect_counters;

// Header of a step's reply.
typedef struct contactd_step_reply {
    // The request's step number.
    uint64_t step;
    // Epoch of the server.
    uint64_t epoch;
    // `STEP_…`.
    uint32_t status;
    // Number of an error code, 0 for none.
    uint32_t error;
    // Index of the offending record, or CONTACTD_NO_INDEX.
    uint32_t index;
    // Contact records at the head of the slice.
    uint32_t records;
    // Further slots behind them.
    uint32_t slots;
    // 1 when `max_records` left records out.
    uint32_t truncated;
    // Bits of the effects that ran (`effects::EFFECT_…`).
    uint32_t effects;
    // Pairs whose plan was continuous or discrete and which the broad phase let through.
    uint32_t pairs;
    // Smallest time_lower over all pairs: safe to advance to.
    double safe_time;
    // Work: what was done, never part of the answer's bits.
    struct contactd_work_counters counters;
    // How often each effect was worked out; no part of the answer's bits either.
    struct contactd_effect_counters effect_counters;
} contactd_step_reply;

// The answer for a pair. World frame; times are fractions of the step; the normal points from `a` to `b`; a field
// whose `valid` bit is clear is zero.
typedef struct contactd_record {
    // The object with the smaller id.
    uint32_t a;
    // The other one.
    uint32_t b;
    // CONTACTD_CONTACT, CONTACTD_CLEAR, CONTACTD_OVERLAP or CONTACTD_UNDECIDED.
    uint8_t status;
    // Index into CONTACTD_KIND_NAMES.
    uint8_t kind;
    // Index into CONTACTD_EXTENT_NAMES.
    uint8_t extent;
    // CONTACTD_TOUCHING, CONTACTD_NOT_CONTINUED, CONTACTD_AVERAGED_NORMAL, CONTACTD_SENSOR, CONTACTD_REGIONS_INCOMPLETE, CONTACTD_WITHIN_MARGIN,
    // CONTACTD_COARSER_RESOLUTION.
    uint8_t flags;
    // A bit per field that has meaning.
    uint32_t valid;
    // Where the surfaces meet.
    double time;
    // Proven: nothing deeper than the resolution before it.
    double time_lower;
    // Contact point, or a point that proves an overlap: deeper than twice the resolution in both bodies. The deepest one is
    // in the detail slot, where penetration is asked for.
    double point[3];
    // Unit normal from a to b.
    double normal[3];
    // Positive apart, negative = penetration; length. Of an overlap what its point proves of the depth.
    double separation;
    // Approach speed along the normal, length per step, positive = approaching.
    double normal_speed;
    // Active faces of a, by id within its model; CONTACTD_NO_FACE fills.
    uint32_t faces_a[3];
    // Active faces of b.
    uint32_t faces_b[3];
    // Index of its first further slot within the reply.
    uint32_t slot;
    // Number of its further slots.
    uint32_t slots;
} contactd_record;

// The answer to a step. The header is a copy; records and slots are read in place and valid until the session's next
// contactd_begin_step, contactd_resend, contactd_reconnect or contactd_close.
typedef struct contactd_reply {
    // Status, safe time, effects, work.
    struct contactd_step_reply header;
    // The contact records in the order (time, a, b).
    const struct contactd_record *records;
    // Number of them.
    size_t record_count;
    // All slots as they lie in memory: the records, then their further slots.
    const struct contactd_record *slots;
    // Number of them.
    size_t slot_count;
} contactd_reply;

// One object's motion, as it lies in shared memory.
typedef struct contactd_pose_record {
    // Object id of the session.
    uint32_t object;
    // Exactly one of CONTACTD_END, CONTACTD_TURN, CONTACTD_START.
    uint32_t flags;
    // Position x, y, z of the object's origin in the world.
    double position[3];
    // Quaternion x, y, z, w; for CONTACTD_TURN the rotation vector and a zero.
    double rotation[4];
} contactd_pose_record;

// What is asked of the steps to come. Stays as it is set, but for `advance`, which each accepted step puts back to 1.
typedef struct contactd_options {
    // Fraction 0..1 of its previous step at which every object stands before the next one.
    double advance;
    // Duration of a step in seconds, for objects with a declared largest speed; 0: unknown.
    double dt;
    // 1: only the pairs whose bracket meets the scene's earliest contact.
    uint32_t first;
    // 1: a detail slot with each record (contactd_get_detail).
    uint32_t details;
    // 1: records of clear pairs too.
    uint32_t clear;
    // 1: this client polls while it waits; the server then need not wake it.
    uint32_t polling;
    // Most records, the earliest first; 0: all.
    uint32_t max_records;
    // Most cells that one pair's search may refine; 0: the server's default.
    uint32_t cell_limit;
    // Most cells that all searches of a step may refine together; 0: the server's default. Pairs that would need more stay
    // undecided, the latest first.
    uint32_t batch_limit;
    // Zero.
    uint32_t reserved;
} contactd_options;

// A further slot: what few callers need of every pair.
typedef struct contactd_detail_slot {
    // CONTACTD_DETAIL_SLOT.
    uint32_t tag;
    // Zero.
    uint32_t reserved;
    // A verified witness of the resolution's depth exists then.
    double time_upper;
    // The resolution that the answer speaks of, a length; larger than the pair's own with CONTACTD_COARSER_RESOLUTION.
    double resolution;
    // The contact point in a's object frame; of an overlap whose penetration is asked for the deepest point.
    double point_a[3];
    // Lower bound of the depth at the start of an overlap; 0 otherwise.
    double penetration;
    // Unit direction from a to b along which it was measured.
    double direction[3];
    // Cells that the pair's search refined.
    uint64_t cells;
    // Of a pair with a margin: proven farther apart than that until then, if it is clear; 1: for the whole step. 0 without a
    // margin.
    double margin_time;
    // Zero.
    uint64_t spare[4];
} contactd_detail_slot;

// A further slot: the least distance of a pair over the step, where its rule asks for it; the last of its record.
typedef struct contactd_clearance_slot {
    // CONTACTD_CLEARANCE_SLOT.
    uint32_t tag;
    // CONTACTD_CLEARANCE_SETTLED, CONTACTD_CLEARANCE_POINTS.
    uint32_t flags;
    // Proven: at no time of the step are two points of the bodies nearer to each other. A length; infinite where a body is empty.
    double lower;
    // Proven: two points of them come as near; 0 where the bodies share a point, infinite where no points were found.
    double upper;
    // When they do, fraction of the step.
    double time;
    // The point of a and that of b, world frame, at that time.
    double points[2][3];
    // Faces of a at its point, by id within its model; CONTACTD_NO_FACE fills.
    uint32_t faces_a[3];
    // Faces of b.
    uint32_t faces_b[3];
    // The tolerance that was asked for, a length.
    double tolerance;
    // Pairs of parts that were looked at.
    uint64_t cells;
    // Zero.
    uint64_t spare;
} contactd_clearance_slot;

// A further slot: a contact region; the contactd_patch_slots with its points follow it.
typedef struct contactd_region_slot {
    // CONTACTD_REGION_SLOT.
    uint32_t tag;
    // Which region of the pair it is, from 0.
    uint32_t region;
    // Index into CONTACTD_KIND_NAMES.
    uint8_t kind;
    // Index into CONTACTD_EXTENT_NAMES.
    uint8_t extent;
    // Zero.
    uint8_t reserved[2];
    // Number of points that bound it.
    uint32_t points;
    // Unit normal from a to b, world frame; the mean one of a curved patch.
    double normal[3];
    // Faces of a that meet there, by id within its model; CONTACTD_NO_FACE fills.
    uint32_t faces_a[3];
    // Faces of b.
    uint32_t faces_b[3];
    // Smallest separation of its points, length.
    double separation;
    // Zero.
    uint64_t spare[7];
} contactd_region_slot;

// A further slot: up to four points of a contact region.
typedef struct contactd_patch_slot {
    // CONTACTD_PATCH_SLOT.
    uint32_t tag;
    // Number of points that are set.
    uint32_t count;
    // The points, world frame.
    double points[4][3];
    // Separation at each point.
    float separations[4];
    // Which region of the pair the points belong to, and a zero.
    uint32_t region[2];
} contactd_patch_slot;

// How far apart two objects are.
typedef struct contactd_distance {
    // Proven: no two points of them are nearer to each other.
    double lower;
    // Proven: two points of them are no farther apart; 0 where they share one, infinite where none were found.
    double upper;
    // A point of the first object, as far from that of the second one as `upper` but for rounding; NaN where none was found.
    double point_a[3];
    // A point of the second object.
    double point_b[3];
    // Pairs of parts that were looked at.
    uint64_t cells;
    // 1 when the bounds are as near to each other as was asked, or as rounding lets them be.
    uint32_t settled;
    // Zero.
    uint32_t reserved;
} contactd_distance;

// What is asked of points; contactd_point_query_new sets the defaults.
typedef struct contactd_point_query {
    // Points no farther from the surface than this are on it, a length >= 0; 1e-9.
    double surface;
    // How far apart the bounds may be, a length; infinite: the side is enough; 1e-6.
    double tolerance;
    // Most parts of a solid that may be looked at for a point; 200,000.
    uint64_t limit;
    // Ids of the objects that are asked, NULL for all.
    const uint32_t *objects;
    // How many.
    size_t object_count;
} contactd_point_query;

// What is asked of rays; contactd_ray_query_new sets the defaults.
typedef struct contactd_ray_query {
    // A ray that comes no deeper than this into a solid passes it: a length >= 0; 0, which is raised to what rounding needs.
    double depth;
    // Most stretches that may be looked at for a ray and an object; 200,000.
    uint64_t limit;
    // Ids of the objects that are asked, NULL for all.
    const uint32_t *objects;
    // How many.
    size_t object_count;
} contactd_ray_query;

// The answer about a point, as it lies in memory in C and Python.
typedef struct contactd_point_record {
    // The object with the least signed distance, or CONTACTD_NO_OBJECT.
    uint32_t object;
    // On which side of its surface: 0 inside, 1 outside, 2 on it, 3 undecided.
    uint8_t side;
    // 1 when the bounds are as near to each other as was asked, or as rounding lets them be.
    uint8_t settled;
    // Zero.
    uint8_t reserved[2];
    // Proven: the least signed distance is no less.
    double lower;
    // Proven: it is no more.
    double upper;
    // The point of the object's surface that was found nearest; NaN where none was found.
    double nearest[3];
    // Faces there, by face id of the object's model; `NO_FACE` fills.
    uint32_t faces[3];
    // Zero.
    uint32_t spare;
    // Parts that were looked at.
    uint64_t cells;
} contactd_point_record;

// A ray: origin + t · direction, 0 <= t <= length, with the direction made a unit vector.
typedef struct contactd_ray {
    // Where it begins.
    double origin[3];
    // Where it goes; of any length but 0.
    double direction[3];
    // How far it goes: a length >= 0; of objects without bounds nothing is told beyond some 1e10 times where it begins.
    double length;
} contactd_ray;

// The answer about a ray, as it lies in memory in C and Python.
typedef struct contactd_ray_record {
    // The object that is hit, or the one in which the whole ray lies, or CONTACTD_NO_OBJECT.
    uint32_t object;
    // 0 hit, 1 miss, 2 undecided.
    uint8_t outcome;
    // 1 when it begins in the object: it leaves it at the hit, or lies in it.
    uint8_t inside;
    // Zero.
    uint8_t reserved[2];
    // Proven: nothing is crossed before; of a miss infinite.
    double lower;
    // Where it meets the surface: lower <= t <= upper, lengths along the ray; NaN without a hit.
    double t;
    // Proven: here it is in the object, or, of a ray that leaves, out of it; infinite without a hit.
    double upper;
    // The point at `t`; NaN without a hit.
    double point[3];
    // Unit normal of the surface there, out of the object; NaN without a hit.
    double normal[3];
    // The face that is crossed, by its id within the object's model; `NO_FACE` without a hit.
    uint32_t face;
    // All faces that meet there, three at most; `NO_FACE` fills.
    uint32_t faces[3];
    // Stretches that were looked at.
    uint64_t cells;
} contactd_ray_record;

// What was recorded.
typedef struct contactd_recording {
    // Steps that stand in the file, or are on their way to it.
    uint64_t steps;
    // Steps that were left out because the recorder could not keep up.
    uint64_t dropped;
    // Steps that stand in it without a picture, for the same reason.
    uint64_t without_picture;
    // Bytes written.
    uint64_t bytes;
} contactd_recording;

// A contact point of a pair.
typedef struct contactd_manifold_point {
    // Names the point within its pair, for as long as it lasts.
    uint32_t id;
    // Which of the pair's groups of one normal it belongs to, from 0.
    uint32_t group;
    // Half way between the surfaces, world frame.
    double position[3];
    // Unit normal from a to b, world frame.
    double normal[3];
    // Distance of the surfaces along the normal: positive apart, negative in penetration.
    double separation;
    // The point on a's surface, in a's object frame.
    double on_a[3];
    // The point on b's surface, in b's object frame.
    double on_b[3];
} contactd_manifold_point;

// The points of a pair, valid until the next call of contactd_manifolds_update or contactd_manifolds_free.
typedef struct contactd_manifold {
    // The object with the smaller id.
    uint32_t a;
    // The other one.
    uint32_t b;
    // The record's status: contact, clear or overlap.
    uint32_t status;
    // 0: the work limit cut the search for regions, there may be more points.
    uint32_t is_complete;
    // Groups in the order in which they were told, the points of each by id.
    const struct contactd_manifold_point *points;
    // Number of them.
    size_t point_count;
} contactd_manifold;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What was wrong with the last call that failed on this thread, in one sentence; "" if none did. Valid until the next call
// that fails on this thread.
const char *contactd_error_message(void);

// Index of the record of a batch, or of the rule, that the last call that failed on this thread was refused for;
// CONTACTD_NO_INDEX: none in particular.
uint32_t contactd_error_index(void);

// Version of the library, as CONTACTD_VERSION was when it was built.
const char *contactd_version(void);

// Version of the protocol that the library speaks; a server of another one is refused.
uint32_t contactd_protocol_version(void);

// A session on the server called `name` of this user; NULL: "default". `*session` is NULL unless the code is CONTACTD_OK.
int32_t contactd_connect(const char *name, struct contactd_session **session);

// A session on an engine of its own in this process: the same calls and the same bits, no server. `config` is a server's
// configuration file (TOML), or NULL for its defaults. `*session` is NULL unless the code is CONTACTD_OK.
int32_t contactd_embedded(const char *config, struct contactd_session **session);

// Ends the session, frees all that belongs to it and sets `*session` to NULL; a step in flight is waited for, a second
// at most. What the code says changes nothing about that, except CONTACTD_ERROR_MISUSE from another thread or from within a
// call: then nothing happened. A `*session` that is NULL already is done.
int32_t contactd_close(struct contactd_session **session);

// The session's id, its server's epoch (0 embedded) and the most records of a batch.
int32_t contactd_get_opened(struct contactd_session *session, struct contactd_opened *opened);

// How long a command (everything but steps) may take, in seconds; 600 unless set. Imports of large models are commands. After
// CONTACTD_ERROR_TIMEOUT what was asked may be done yet: contactd_reconnect goes back to before it.
int32_t contactd_set_command_timeout(struct contactd_session *session, double timeout);

// After CONTACTD_ERROR_SERVER_LOST, CONTACTD_ERROR_REPLY_LOST or a session that is gone: waits up to `timeout` seconds until a
// server of the same name runs, opens a session there and replays models, objects, rules and last poses. Ids stay the same. A
// step that has no answer is kept for contactd_resend. On an embedded session there is nothing to find again:
// CONTACTD_ERROR_MISUSE.
int32_t contactd_reconnect(struct contactd_session *session, double timeout);

// Loads a model from OpenSCAD CSG text; `name` stands in error sentences; `facets` is CONTACTD_FACETS_…, how curved
// primitives are taken. `*model` is its id.
int32_t contactd_load_model(struct contactd_session *session,
                            const char *name,
                            const char *csg,
                            uint32_t facets,
                            uint32_t *model);

// Loads a model from the `length` bytes of a file, text or not. `format` is what they are, such as "csg"; NULL: as `name` ends. A format that the
// server does not read is refused by name. Otherwise as contactd_load_model.
int32_t contactd_load_model_file(struct contactd_session *session,
                                 const char *name,
                                 const char *format,
                                 const uint8_t *bytes,
                                 size_t length,
                                 uint32_t facets,
                                 uint32_t *model);

// Number of a model's faces, and of the warnings of its import: what it snapped or dropped.
int32_t contactd_count_faces(struct contactd_session *session, uint32_t model, uint32_t *faces, uint32_t *warnings);

// A face of a model, by its id: what a record's `faces_a` and `faces_b` name.
int32_t contactd_get_face(struct contactd_session *session, uint32_t model, uint32_t face, struct contactd_face *out);

// A warning of a model's import, by its number from 0. The string is valid until the session is closed.
int32_t contactd_get_warning(struct contactd_session *session, uint32_t model, uint32_t warning, const char **out);

// Volume, centre of mass and inertia of a model, in the model's own frame and unit, density 1. `tolerance`: error of the
// volume that is good enough, as a fraction of it (0: 1e-6). `boxes`: most boxes that may be looked at (0: a million); where
// they do not suffice the answer carries the larger bounds that were reached. A model that reaches to infinity is refused.
int32_t contactd_mass_properties(struct contactd_session *session,
                                 uint32_t model,
                                 double tolerance,
                                 uint64_t boxes,
                                 struct contactd_mass *mass);

// The same solid seen from the parent of `pose`: with an object's place, the model's properties become the object's. `out` may
// be `mass`.
int32_t contactd_mass_placed(const struct contactd_mass *mass, const struct contactd_pose *pose, struct contactd_mass *out);

// The same solid of another density, mass per volume, which is taken as exact. `out` may be `mass`.
int32_t contactd_mass_with_density(const struct contactd_mass *mass, double density, struct contactd_mass *out);

// A box with these lengths of its edges, centred at the origin of its frame as every solid here.
int32_t contactd_solid_box(double x, double y, double z, struct contactd_solid **out);

// A ball.
int32_t contactd_solid_sphere(double radius, struct contactd_solid **out);

// A cylinder along z, from -height/2 to height/2.
int32_t contactd_solid_cylinder(double radius, double height, struct contactd_solid **out);

// A cone or frustum along z, of radius `bottom` at -height/2 and `top` at height/2; one of them may be 0.
int32_t contactd_solid_cone(double bottom, double top, double height, struct contactd_solid **out);

// All points within `minor` of the circle of radius `major` about z.
int32_t contactd_solid_torus(double major, double minor, struct contactd_solid **out);

// All points within `radius` of the segment along z from -length/2 to length/2.
int32_t contactd_solid_capsule(double radius, double length, struct contactd_solid **out);

// A dome along z, from its rim of radius `radius` at -height/2 to its tip at height/2: (x^2 + y^2)/radius^2 <= 1/2 - z/height
// above the rim.
int32_t contactd_solid_paraboloid(double radius, double height, struct contactd_solid **out);

// A hyperboloid of one sheet about z, of radius `radius` at -height/2 and height/2 and `waist`, which is smaller, at z = 0.
int32_t contactd_solid_hyperboloid(double radius, double waist, double height, struct contactd_solid **out);

// A dome as a paraboloid's, of one sheet of a hyperboloid of two: downwards it nears a cone, whose tip is `cone` above its
// own.
int32_t contactd_solid_hyperbolic_dome(double radius, double height, double cone, struct contactd_solid **out);

// All points of the box from `min` to `max` (3 numbers each) with [x y z 1] M [x y z 1]' <= 0. `m`: the 16 numbers of M, a
// symmetric matrix. Planes alone are none.
int32_t contactd_solid_quadric(const double *m, const double *min, const double *max, struct contactd_solid **out);

// All points with (|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1) <= 1. `radii`: a, b and c; `exponents`: e1 (north to south) and e2
// (east to west), each from 0.1 to 1.
int32_t contactd_solid_superellipsoid(const double *radii,
                                      const double *exponents,
                                      struct contactd_solid **out);

// The half-space normal.x <= offset |normal|: a floor or a wall of its own, or to be cut with something. `normal`: 3
// numbers.
int32_t contactd_solid_half_space(const double *normal, double offset, struct contactd_solid **out);

// The solid between the plane z = `base` and heights above it: `rows` rows that go up in y, each of `columns` heights
// that go up in x, at the corners of equal cells of a rectangle of the lengths `x` and `y` about the origin. Each cell
// is two triangles that meet along the diagonal from its corner of least x and y to that of most.
int32_t contactd_solid_height_field(const double *heights,
                                    size_t rows,
                                    size_t columns,
                                    double x,
                                    double y,
                                    double base,
                                    struct contactd_solid **out);

// The solid within faces, convex or not. `points`: 3 numbers each. `corners`: indices of points, those of each face
// counter-clockwise as seen from outside, one face after the other; `sides`: how many of them each face has.
int32_t contactd_solid_polyhedron(const double *points,
                                  size_t point_count,
                                  const uint32_t *corners,
                                  const uint32_t *sides,
                                  size_t face_count,
                                  struct contactd_solid **out);

// CONTACTD_UNION, _INTERSECTION, _DIFFERENCE, _HULL or _MINKOWSKI of solids, which stay the caller's.
int32_t contactd_solid_join(uint32_t operation,
                            const struct contactd_solid *const *operands,
                            size_t count,
                            struct contactd_solid **out);

// A solid under an affine map. `matrix`: 12 numbers, the three rows of 3 of its linear part and a translation each.
int32_t contactd_solid_transformed(const struct contactd_solid *of, const double *matrix, struct contactd_solid **out);

// A solid whose curves are cut into `pieces`, 9 or more, where something made of them has no exact form.
int32_t contactd_solid_with_pieces(const struct contactd_solid *of, uint32_t pieces, struct contactd_solid **out);

// OpenSCAD's text of a solid, which is what is loaded. Valid until the solid is freed.
int32_t contactd_solid_text(struct contactd_solid *of, const char **out);

// Frees a solid and sets `*of` to NULL; one that is NULL already is done.
int32_t contactd_solid_free(struct contactd_solid **of);

// Loads a solid as contactd_load_model loads its text.
int32_t contactd_load_solid(struct contactd_session *session,
                            const char *name,
                            const struct contactd_solid *of,
                            uint32_t facets,
                            uint32_t *model);

// A disc.
int32_t contactd_outline_circle(double radius, struct contactd_outline **out);

// A rectangle with these lengths of its sides, centred.
int32_t contactd_outline_rectangle(double x, double y, struct contactd_outline **out);

// What is within an odd number of closed paths: one, or an outline with holes. `points`: 2 numbers each, those of one path after
// those of another; `corners`: how many each path has.
int32_t contactd_outline_polygon(const double *points,
                                 const uint32_t *corners,
                                 size_t path_count,
                                 struct contactd_outline **out);

// CONTACTD_UNION, _INTERSECTION, _DIFFERENCE or _HULL of outlines, which stay the caller's.
int32_t contactd_outline_join(uint32_t operation,
                              const struct contactd_outline *const *operands,
                              size_t count,
                              struct contactd_outline **out);

// Everything within `by` of an outline, or, below 0, what is farther than that inside; `corners` is CONTACTD_CORNERS_….
int32_t contactd_outline_offset(const struct contactd_outline *of, double by, uint32_t corners, struct contactd_outline **out);

// An outline under an affine map. `matrix`: 6 numbers, the two rows of 2 of its linear part and a translation each.
int32_t contactd_outline_transformed(const struct contactd_outline *of, const double *matrix, struct contactd_outline **out);

// The solid over an outline from z = -height/2 to height/2, scaled by `scale_x`, `scale_y` towards its upper end (1 and 1: straight).
int32_t contactd_outline_extrude(const struct contactd_outline *of,
                                 double height,
                                 double scale_x,
                                 double scale_y,
                                 struct contactd_solid **out);

// The same, turned about z towards its upper end by `angle` (radians, counter-clockwise) in `slices` steps.
int32_t contactd_outline_twist(const struct contactd_outline *of,
                               double height,
                               double angle,
                               uint32_t slices,
                               struct contactd_solid **out);

// The solid that an outline makes about an axis, over `angle` radians from +x: its x becomes the distance from z, its y becomes z.
int32_t contactd_outline_revolve(const struct contactd_outline *of,
                                 double angle,
                                 struct contactd_solid **out);

// The outline that the plane z = 0 cuts out of a solid (`cut` 1), or the solid's shadow on it (0).
int32_t contactd_solid_projection(const struct contactd_solid *of, uint32_t cut, struct contactd_outline **out);

// Frees an outline and sets `*of` to NULL; one that is NULL already is done.
int32_t contactd_outline_free(struct contactd_outline **of);

// A moving object of group "default" at the origin. Name and group are copied when it is added.
struct contactd_object contactd_object_new(const char *name, uint32_t model);

// The rule of two groups with every other field at its default: continuous, report contact, an overlap is the answer.
struct contactd_rule contactd_rule_new(const char *a, const char *b);

// Adds an object; `*id` is its id, which stays the same over restarts of the server and is never used again.
int32_t contactd_add_object(struct contactd_session *session, const struct contactd_object *object, uint32_t *id);

// Removes an object; its id is not used again. What it carried is detached before.
int32_t contactd_remove_object(struct contactd_session *session, uint32_t id);

// Replaces the session's rules. The first rule that names a pair decides; a pair that no rule names is off once there are
// rules; without rules every pair is continuous, report contact. contactd_error_index names the rule that was refused.
int32_t contactd_set_rules(struct contactd_session *session, const struct contactd_rule *rules, size_t count);

// From now on `part` moves with `carrier` as it stands to it (at `options.advance` of the last step), and is not tested against it nor
// against the `count` objects in `touching`. It has the carrier's frame and gets its records; a record of its own is refused. Refused, too:
// a part to itself or to what it carries, and names that other objects share with those that are not tested.
int32_t contactd_attach(struct contactd_session *session,
                        uint32_t part,
                        uint32_t carrier,
                        const uint32_t *touching,
                        size_t count);

// The part stays where it is (at `options.advance` of the last step), in the frame that it had of its own, with what is attached to it, and
// is tested as the rules say. Nothing where it is not attached. `advance` must be left as it is until the next step, here and where a part
// is attached or its carrier removed: a step that begins elsewhere is misuse.
int32_t contactd_detach(struct contactd_session *session,
                        uint32_t part);

// A pair of objects that may meet and is not tested, whatever the rules say; `allowed` 0: it is no longer.
int32_t contactd_allow(struct contactd_session *session, uint32_t a, uint32_t b, uint32_t allowed);

// Sets the resolution of every pair, a length; 0: each its default (1e-9 of the larger bounding radius).
int32_t contactd_set_resolution(struct contactd_session *session, double resolution);

// Options with defaults: a robot stands where its file says, and the scene's rules replace the session's.
struct contactd_scene_options contactd_scene_options_new(void);

// Loads a scene file (.toml) or a robot or world (URDF, SDFormat, MJCF) into the session, beside what it has; `options` may be NULL.
// The caller's process reads the files and sends what they name along. Objects, motions and rules are those of `contactd check`, to the
// bit. What is wrong is one sentence with file, line and column, and the session keeps what it had, but for models. The scene is to be
// freed by contactd_scene_free, before or after its session is closed.
int32_t contactd_load_scene(struct contactd_session *session,
                            const char *path,
                            const struct contactd_scene_options *options,
                            struct contactd_scene **scene);

// Frees a scene and sets `*scene` to NULL; its objects stay in the session. One that is NULL already is done.
int32_t contactd_scene_free(struct contactd_scene **scene);

// What a scene has in it.
int32_t contactd_scene_get_info(struct contactd_scene *scene, struct contactd_scene_info *out);

// An object of a scene by its number from 0, in the order of the file.
int32_t contactd_scene_get_object(struct contactd_scene *scene, size_t index, struct contactd_scene_object *out);

// The id of the object of a name.
int32_t contactd_scene_find(struct contactd_scene *scene, const char *name, uint32_t *id);

// A joint of a robot that has a value of its own, by its number from 0, in the order of the file.
int32_t contactd_scene_get_joint(struct contactd_scene *scene, size_t index, struct contactd_joint *out);

// A note by its number from 0: a sentence about what has no effect, was left out or was taken in another way.
int32_t contactd_scene_get_note(struct contactd_scene *scene, size_t index, const char **note);

// Gives the session the scene's rules instead of its own: those that `keeps_rules` left aside.
int32_t contactd_scene_set_rules(struct contactd_session *session, struct contactd_scene *scene);

// Puts a robot where its joints have these `count` values (radians, metres), the others as they stand; nothing is searched. What is
// attached to a link goes along. Refused where a joint is not there, or a value beyond its limits.
int32_t contactd_scene_set_joints(struct contactd_session *session,
                                  struct contactd_scene *scene,
                                  const struct contactd_joint_value *joints,
                                  size_t count);

// A step in which a robot's joints go from where they stand to these `count` values at constant rates, its links on their true arcs; of
// a scene file its own step, by no values. Its records are sent alone and answered as by contactd_finish. Refused where two hinges would
// turn a link at once, which is no arc: move one after the other. A robot whose step is refused stands where it was.
int32_t contactd_scene_step(struct contactd_session *session,
                            struct contactd_scene *scene,
                            const struct contactd_joint_value *joints,
                            size_t count,
                            double timeout,
                            struct contactd_reply *reply);

// The records of that step, to be put into a batch with those of other objects: `*written` of them into `records`, which has room for
// `room`; no more than the scene has objects. After it the joints stand at its end. Where there is not room enough nothing is done.
int32_t contactd_scene_records(struct contactd_session *session,
                               struct contactd_scene *scene,
                               const struct contactd_joint_value *joints,
                               size_t count,
                               struct contactd_pose_record *records,
                               size_t room,
                               size_t *written);

// The step of the last contactd_scene_records was refused: nothing has moved, and a robot's joints are where they were.
int32_t contactd_scene_refused(struct contactd_scene *scene);

// Puts a robot where its joints were at a time, 0 to 1, of the last step: where it met something, say.
int32_t contactd_scene_stop_at(struct contactd_session *session, struct contactd_scene *scene, double time);

// What is asked of the steps to come, as it is set.
int32_t contactd_get_options(struct contactd_session *session, struct contactd_options *options);

// Sets what is asked of the steps to come: get it, change it, set it.
int32_t contactd_set_options(struct contactd_session *session, const struct contactd_options *options);

// Sets the option `advance` alone: the fraction 0..1 of its previous step at which every object stands before the next one.
int32_t contactd_set_advance(struct contactd_session *session, double advance);

// `*poses` are slots for `count` poses, all zero, to be filled in place; objects that are not named rest. A batch that was begun
// and not sent is dropped, and so are the records of the last reply.
int32_t contactd_begin_step(struct contactd_session *session,
                            size_t count,
                            struct contactd_pose_record **poses);

// Sends the batch without waiting; contactd_finish does it too.
int32_t contactd_send(struct contactd_session *session);

// Sends the batch if it was not yet, and waits up to `timeout` seconds for its answer. A batch that is refused has changed
// nothing; contactd_error_index names its offending record. After CONTACTD_ERROR_TIMEOUT the step stays in flight: call again.
int32_t contactd_finish(struct contactd_session *session, double timeout, struct contactd_reply *reply);

// After contactd_reconnect: the batch that was in flight when the server was lost, begun again with the same poses. It can be
// had until a batch is accepted.
int32_t contactd_resend(struct contactd_session *session, struct contactd_pose_record **poses, size_t *count);

// The detail slot of record number `record` of the last reply, in place; `*slot` is NULL when details were not asked for.
int32_t contactd_get_detail(struct contactd_session *session, size_t record, const struct contactd_detail_slot **slot);

// The least distance over the step of the pair of record number `record` of the last reply, in place; `*slot` is NULL where its rule
// does not ask for its clearance.
int32_t contactd_get_clearance(struct contactd_session *session,
                               size_t record,
                               const struct contactd_clearance_slot **slot);

// Number of contact regions of record number `record` of the last reply: told when its rule reports patches or has a margin.
int32_t contactd_count_regions(struct contactd_session *session, size_t record, uint32_t *count);

// A contact region of record number `record` of the last reply, by its number from 0, and the `*patch_count` slots with the
// points that bound it, in place.
int32_t contactd_get_region(struct contactd_session *session,
                            size_t record,
                            uint32_t region,
                            const struct contactd_region_slot **slot,
                            const struct contactd_patch_slot **patches,
                            size_t *patch_count);

// How far two objects are apart: certified bounds to a tolerance (a length), and a point of each. Queries change nothing, and no
// step's answer.
int32_t contactd_get_distance(struct contactd_session *session,
                              uint32_t a,
                              uint32_t b,
                              double tolerance,
                              struct contactd_distance *distance);

// A query of points with defaults.
struct contactd_point_query contactd_point_query_new(void);

// A query of rays with defaults.
struct contactd_ray_query contactd_ray_query_new(void);

// The least signed distance of `n` points from the objects that are asked, certified: `answers` has room for as many.
int32_t contactd_get_points(struct contactd_session *session,
                            const double (*points)[3],
                            size_t n,
                            const struct contactd_point_query *query,
                            struct contactd_point_record *answers);

// What `n` rays meet first of the objects that are asked, certified: `answers` has room for as many.
int32_t contactd_cast_rays(struct contactd_session *session,
                           const struct contactd_ray *rays,
                           size_t n,
                           const struct contactd_ray_query *query,
                           struct contactd_ray_record *answers);

// Records the session's steps from now on into a new MCAP file, until contactd_stop_recording or the end of the session;
// `contactd replay FILE` repeats it bit for bit. A recorder that cannot keep up leaves out whole steps and counts them: no step
// waits for it. CONTACTD_ERROR_RECORDING: the file exists or cannot be made, the session is being recorded already, or the server
// has a deadline, with which answers depend on time.
int32_t contactd_start_recording(struct contactd_session *session,
                                 const char *path);

// What was recorded so far. CONTACTD_ERROR_RECORDING: nothing is being recorded, or the recording has failed;
// contactd_error_message says why.
int32_t contactd_get_recording(struct contactd_session *session, struct contactd_recording *recording);

// Ends the recording: its file is complete when this returns. Codes as of contactd_get_recording.
int32_t contactd_stop_recording(struct contactd_session *session, struct contactd_recording *recording);

// Writes the last step as a scene in a new folder, for `contactd check FOLDER/scene.toml`. CONTACTD_ERROR_RECORDING: the folder
// exists or cannot be written.
int32_t contactd_save_step(struct contactd_session *session, const char *folder);

// Makes manifolds, without points. Not bound to a session or thread, but used by one thread at a time.
int32_t contactd_manifolds_new(struct contactd_manifolds **manifolds);

// Frees manifolds and sets `*manifolds` to NULL; one that is NULL already is done.
int32_t contactd_manifolds_free(struct contactd_manifolds **manifolds);

// Takes the answer to a step, once after each step. `poses` are two for each of the reply's records in their order, `count` in all: where
// a and b stood at the moment that the record tells of: at its time for contact and overlap, at the start of the step for pairs
// that are clear. (For pairs of detect = "discrete", which are told at their end: there.) Points of the step before keep their ids
// where they are told again; pairs that are not told are forgotten. The rules need report = patch. When anything is wrong nothing has
// changed.
int32_t contactd_manifolds_update(struct contactd_manifolds *manifolds,
                                  const struct contactd_reply *reply,
                                  const struct contactd_pose *poses,
                                  size_t count);

// Number of pairs that have points.
int32_t contactd_manifolds_count(struct contactd_manifolds *manifolds, size_t *count);

// A pair by its number from 0, in the order (a, b).
int32_t contactd_manifolds_get(struct contactd_manifolds *manifolds, size_t index, struct contactd_manifold *out);

// The pair of objects `a` < `b`; with no points (NULL, 0) when they have none.
int32_t contactd_manifolds_find(struct contactd_manifolds *manifolds, uint32_t a, uint32_t b, struct contactd_manifold *out);

// x y z w from w x y z (MuJoCo, Drake, Isaac Sim, SAPIEN, the constructors of Eigen): four numbers to four.
int32_t contactd_quaternion_from_wxyz(const double *wxyz, double *rotation);

// w x y z from x y z w: four numbers to four.
int32_t contactd_quaternion_to_wxyz(const double *rotation, double *wxyz);

// A pose from MuJoCo's `xpos` (3 numbers) and `xquat` (4, w x y z).
int32_t contactd_from_mujoco(const double *xpos, const double *xquat, double *position, double *rotation);

// MuJoCo's `xpos` (3 numbers) and `xquat` (4, w x y z) of a pose.
int32_t contactd_to_mujoco(const double *position, const double *rotation, double *xpos, double *xquat);

// A pose from the seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
int32_t contactd_from_drake(const double *state, double *position, double *rotation);

// The seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
int32_t contactd_to_drake(const double *position, const double *rotation, double *state);

// A pose from [R | p], three rows of four: 12 numbers row by row. CONTACTD_ERROR_ARGUMENT when R is no rotation: scaled,
// skewed, mirrored, by more than 1e-6 in an element of RᵀR − I.
int32_t contactd_from_mat3x4(const double *matrix, double *position, double *rotation);

// [R | p] of a pose, three rows of four: 12 numbers row by row.
int32_t contactd_to_mat3x4(const double *position, const double *rotation, double *matrix);

// A pose from a homogeneous matrix, 16 numbers row by row, with the position in the last column (Drake, pinocchio,
// trimesh). Refused as by contactd_from_mat3x4, and when the last row is not 0 0 0 1.
int32_t contactd_from_mat4(const double *matrix, double *position, double *rotation);

// A homogeneous matrix of a pose, 16 numbers row by row, with the position in the last column.
int32_t contactd_to_mat4(const double *position, const double *rotation, double *matrix);

// A pose from 16 numbers column by column (OpenGL, three.js, Bullet's getOpenGLMatrix). Refused as by contactd_from_mat4.
int32_t contactd_from_opengl(const double *columns, double *position, double *rotation);

// 16 numbers column by column of a pose.
int32_t contactd_to_opengl(const double *position, const double *rotation, double *columns);

// From MuJoCo's `mjContact`: `pos` half way, `frame` of 9 numbers whose first three point from geom 1 to geom 2, `dist` <
// 0 in penetration.
int32_t contactd_contact_from_mujoco(const double *pos,
                                     const double *frame,
                                     double dist,
                                     double *point,
                                     double *normal,
                                     double *separation);

// `pos`, `frame` (the normal, then the two tangents that MuJoCo itself chooses: 9 numbers) and `dist` of `mjContact`.
int32_t contactd_contact_to_mujoco(const double *point,
                                   const double *normal,
                                   double separation,
                                   double *pos,
                                   double *frame,
                                   double *dist);

// From Drake's `PenetrationAsPointPair`: `p_WCa`, `p_WCb` a point of each surface, `nhat_BA_W` from B into A, `depth` > 0
// in penetration.
int32_t contactd_contact_from_drake(const double *p_wca,
                                    const double *p_wcb,
                                    const double *nhat_ba_w,
                                    double depth,
                                    double *point,
                                    double *normal,
                                    double *separation);

// `p_WCa`, `p_WCb`, `nhat_BA_W`, `depth` of Drake's `PenetrationAsPointPair`.
int32_t contactd_contact_to_drake(const double *point,
                                  const double *normal,
                                  double separation,
                                  double *p_wca,
                                  double *p_wcb,
                                  double *nhat_ba_w,
                                  double *depth);

// From Bullet's `btManifoldPoint`: a point of each surface, the normal on B towards A, `distance` < 0 in penetration.
int32_t contactd_contact_from_bullet(const double *on_a,
                                     const double *on_b,
                                     const double *normal_on_b,
                                     double distance,
                                     double *point,
                                     double *normal,
                                     double *separation);

// The points on A and on B, the normal on B and the distance of Bullet's `btManifoldPoint`.
int32_t contactd_contact_to_bullet(const double *point,
                                   const double *normal,
                                   double separation,
                                   double *on_a,
                                   double *on_b,
                                   double *normal_on_b,
                                   double *distance);

// From PhysX's `PxContactPairPoint`: its `position`, its `normal` (here `from_second`: from the second shape to the first)
// and its `separation` (here `gap`), < 0 in penetration.
int32_t contactd_contact_from_physx(const double *position,
                                    const double *from_second,
                                    double gap,
                                    double *point,
                                    double *normal,
                                    double *separation);

// `position`, `normal` and `separation` of PhysX's `PxContactPairPoint`.
int32_t contactd_contact_to_physx(const double *point,
                                  const double *normal,
                                  double separation,
                                  double *position,
                                  double *from_second,
                                  double *gap);

// From ODE's `dContactGeom`: `pos`, its `normal` (here `into_first`: into body 1) and `depth` > 0 in penetration.
int32_t contactd_contact_from_ode(const double *pos,
                                  const double *into_first,
                                  double depth,
                                  double *point,
                                  double *normal,
                                  double *separation);

// `pos`, `normal` and `depth` of ODE's `dContactGeom`.
int32_t contactd_contact_to_ode(const double *point,
                                const double *normal,
                                double separation,
                                double *pos,
                                double *into_first,
                                double *depth);

// From Coal's `Contact`: `pos` half way, its `normal` (here `to_second`: from object 1 to object 2) and
// `penetration_depth` < 0 in penetration.
int32_t contactd_contact_from_coal(const double *pos,
                                   const double *to_second,
                                   double penetration_depth,
                                   double *point,
                                   double *normal,
                                   double *separation);

// `pos`, `normal` and `penetration_depth` of Coal's `Contact`.
int32_t contactd_contact_to_coal(const double *point,
                                 const double *normal,
                                 double separation,
                                 double *pos,
                                 double *to_second,
                                 double *penetration_depth);

// From parry's `Contact` in the world frame: a point of each shape, the normal out of shape 1, `dist` < 0 in penetration.
int32_t contactd_contact_from_rapier(const double *point1,
                                     const double *point2,
                                     const double *normal1,
                                     double dist,
                                     double *point,
                                     double *normal,
                                     double *separation);

// `point1`, `point2`, `normal1` and `dist` of parry's `Contact`, world frame; its `normal2` is the opposite of `normal1`.
int32_t contactd_contact_to_rapier(const double *point,
                                   const double *normal,
                                   double separation,
                                   double *point1,
                                   double *point2,
                                   double *normal1,
                                   double *dist);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CONTACTD_H */

// Sizes and offsets as the library was built with them.
#ifdef __cplusplus
#define CONTACTD_ASSERT static_assert
#else
#define CONTACTD_ASSERT _Static_assert
#endif
#define CONTACTD_SIZE(type, n) CONTACTD_ASSERT(sizeof(type) == n, "size of " #type)
#define CONTACTD_AT(type, field, n) CONTACTD_ASSERT(offsetof(type, field) == n, "place of " #type "." #field)
CONTACTD_SIZE(contactd_pose_record, 64);
CONTACTD_AT(contactd_pose_record, object, 0);
CONTACTD_AT(contactd_pose_record, flags, 4);
CONTACTD_AT(contactd_pose_record, position, 8);
CONTACTD_AT(contactd_pose_record, rotation, 32);
CONTACTD_SIZE(contactd_record, 128);
CONTACTD_AT(contactd_record, a, 0);
CONTACTD_AT(contactd_record, b, 4);
CONTACTD_AT(contactd_record, status, 8);
CONTACTD_AT(contactd_record, kind, 9);
CONTACTD_AT(contactd_record, extent, 10);
CONTACTD_AT(contactd_record, flags, 11);
CONTACTD_AT(contactd_record, valid, 12);
CONTACTD_AT(contactd_record, time, 16);
CONTACTD_AT(contactd_record, time_lower, 24);
CONTACTD_AT(contactd_record, point, 32);
CONTACTD_AT(contactd_record, normal, 56);
CONTACTD_AT(contactd_record, separation, 80);
CONTACTD_AT(contactd_record, normal_speed, 88);
CONTACTD_AT(contactd_record, faces_a, 96);
CONTACTD_AT(contactd_record, faces_b, 108);
CONTACTD_AT(contactd_record, slot, 120);
CONTACTD_AT(contactd_record, slots, 124);
CONTACTD_SIZE(contactd_detail_slot, 128);
CONTACTD_AT(contactd_detail_slot, tag, 0);
CONTACTD_AT(contactd_detail_slot, reserved, 4);
CONTACTD_AT(contactd_detail_slot, time_upper, 8);
CONTACTD_AT(contactd_detail_slot, resolution, 16);
CONTACTD_AT(contactd_detail_slot, point_a, 24);
CONTACTD_AT(contactd_detail_slot, penetration, 48);
CONTACTD_AT(contactd_detail_slot, direction, 56);
CONTACTD_AT(contactd_detail_slot, cells, 80);
CONTACTD_AT(contactd_detail_slot, margin_time, 88);
CONTACTD_AT(contactd_detail_slot, spare, 96);
CONTACTD_SIZE(contactd_region_slot, 128);
CONTACTD_AT(contactd_region_slot, tag, 0);
CONTACTD_AT(contactd_region_slot, region, 4);
CONTACTD_AT(contactd_region_slot, kind, 8);
CONTACTD_AT(contactd_region_slot, extent, 9);
CONTACTD_AT(contactd_region_slot, reserved, 10);
CONTACTD_AT(contactd_region_slot, points, 12);
CONTACTD_AT(contactd_region_slot, normal, 16);
CONTACTD_AT(contactd_region_slot, faces_a, 40);
CONTACTD_AT(contactd_region_slot, faces_b, 52);
CONTACTD_AT(contactd_region_slot, separation, 64);
CONTACTD_AT(contactd_region_slot, spare, 72);
CONTACTD_SIZE(contactd_clearance_slot, 128);
CONTACTD_AT(contactd_clearance_slot, tag, 0);
CONTACTD_AT(contactd_clearance_slot, flags, 4);
CONTACTD_AT(contactd_clearance_slot, lower, 8);
CONTACTD_AT(contactd_clearance_slot, upper, 16);
CONTACTD_AT(contactd_clearance_slot, time, 24);
CONTACTD_AT(contactd_clearance_slot, points, 32);
CONTACTD_AT(contactd_clearance_slot, faces_a, 80);
CONTACTD_AT(contactd_clearance_slot, faces_b, 92);
CONTACTD_AT(contactd_clearance_slot, tolerance, 104);
CONTACTD_AT(contactd_clearance_slot, cells, 112);
CONTACTD_AT(contactd_clearance_slot, spare, 120);
CONTACTD_SIZE(contactd_patch_slot, 128);
CONTACTD_AT(contactd_patch_slot, tag, 0);
CONTACTD_AT(contactd_patch_slot, count, 4);
CONTACTD_AT(contactd_patch_slot, points, 8);
CONTACTD_AT(contactd_patch_slot, separations, 104);
CONTACTD_AT(contactd_patch_slot, region, 120);
CONTACTD_SIZE(contactd_step_reply, 232);
CONTACTD_AT(contactd_step_reply, step, 0);
CONTACTD_AT(contactd_step_reply, epoch, 8);
CONTACTD_AT(contactd_step_reply, status, 16);
CONTACTD_AT(contactd_step_reply, error, 20);
CONTACTD_AT(contactd_step_reply, index, 24);
CONTACTD_AT(contactd_step_reply, records, 28);
CONTACTD_AT(contactd_step_reply, slots, 32);
CONTACTD_AT(contactd_step_reply, truncated, 36);
CONTACTD_AT(contactd_step_reply, effects, 40);
CONTACTD_AT(contactd_step_reply, pairs, 44);
CONTACTD_AT(contactd_step_reply, safe_time, 48);
CONTACTD_AT(contactd_step_reply, counters, 56);
CONTACTD_AT(contactd_step_reply, effect_counters, 144);
CONTACTD_SIZE(contactd_work_counters, 88);
CONTACTD_AT(contactd_work_counters, box_tests, 0);
CONTACTD_AT(contactd_work_counters, primitives, 8);
CONTACTD_AT(contactd_work_counters, after_stage1, 16);
CONTACTD_AT(contactd_work_counters, node_pairs, 24);
CONTACTD_AT(contactd_work_counters, candidates, 32);
CONTACTD_AT(contactd_work_counters, cells, 40);
CONTACTD_AT(contactd_work_counters, clauses, 48);
CONTACTD_AT(contactd_work_counters, newton, 56);
CONTACTD_AT(contactd_work_counters, closed_forms, 64);
CONTACTD_AT(contactd_work_counters, may_have_passed, 72);
CONTACTD_AT(contactd_work_counters, instant_cells, 80);
CONTACTD_SIZE(contactd_pose, 56);
CONTACTD_AT(contactd_pose, position, 0);
CONTACTD_AT(contactd_pose, rotation, 24);
CONTACTD_SIZE(contactd_opened, 24);
CONTACTD_AT(contactd_opened, session, 0);
CONTACTD_AT(contactd_opened, epoch, 8);
CONTACTD_AT(contactd_opened, max_batch, 16);
CONTACTD_AT(contactd_opened, reserved, 20);
CONTACTD_SIZE(contactd_recording, 32);
CONTACTD_AT(contactd_recording, steps, 0);
CONTACTD_AT(contactd_recording, dropped, 8);
CONTACTD_AT(contactd_recording, without_picture, 16);
CONTACTD_AT(contactd_recording, bytes, 24);
CONTACTD_SIZE(contactd_face, 24);
CONTACTD_AT(contactd_face, primitive, 0);
CONTACTD_AT(contactd_face, subtracted, 4);
CONTACTD_AT(contactd_face, name, 8);
CONTACTD_AT(contactd_face, face, 16);
CONTACTD_SIZE(contactd_mass, 176);
CONTACTD_AT(contactd_mass, volume, 0);
CONTACTD_AT(contactd_mass, volume_error, 8);
CONTACTD_AT(contactd_mass, center, 16);
CONTACTD_AT(contactd_mass, center_error, 40);
CONTACTD_AT(contactd_mass, density, 64);
CONTACTD_AT(contactd_mass, inertia, 72);
CONTACTD_AT(contactd_mass, inertia_error, 120);
CONTACTD_AT(contactd_mass, boxes, 168);
CONTACTD_SIZE(contactd_ray, 56);
CONTACTD_AT(contactd_ray, origin, 0);
CONTACTD_AT(contactd_ray, direction, 24);
CONTACTD_AT(contactd_ray, length, 48);
CONTACTD_SIZE(contactd_point_query, 40);
CONTACTD_AT(contactd_point_query, surface, 0);
CONTACTD_AT(contactd_point_query, tolerance, 8);
CONTACTD_AT(contactd_point_query, limit, 16);
CONTACTD_AT(contactd_point_query, objects, 24);
CONTACTD_AT(contactd_point_query, object_count, 32);
CONTACTD_SIZE(contactd_ray_query, 32);
CONTACTD_AT(contactd_ray_query, depth, 0);
CONTACTD_AT(contactd_ray_query, limit, 8);
CONTACTD_AT(contactd_ray_query, objects, 16);
CONTACTD_AT(contactd_ray_query, object_count, 24);
CONTACTD_SIZE(contactd_point_record, 72);
CONTACTD_AT(contactd_point_record, object, 0);
CONTACTD_AT(contactd_point_record, side, 4);
CONTACTD_AT(contactd_point_record, settled, 5);
CONTACTD_AT(contactd_point_record, reserved, 6);
CONTACTD_AT(contactd_point_record, lower, 8);
CONTACTD_AT(contactd_point_record, upper, 16);
CONTACTD_AT(contactd_point_record, nearest, 24);
CONTACTD_AT(contactd_point_record, faces, 48);
CONTACTD_AT(contactd_point_record, spare, 60);
CONTACTD_AT(contactd_point_record, cells, 64);
CONTACTD_SIZE(contactd_ray_record, 104);
CONTACTD_AT(contactd_ray_record, object, 0);
CONTACTD_AT(contactd_ray_record, outcome, 4);
CONTACTD_AT(contactd_ray_record, inside, 5);
CONTACTD_AT(contactd_ray_record, reserved, 6);
CONTACTD_AT(contactd_ray_record, lower, 8);
CONTACTD_AT(contactd_ray_record, t, 16);
CONTACTD_AT(contactd_ray_record, upper, 24);
CONTACTD_AT(contactd_ray_record, point, 32);
CONTACTD_AT(contactd_ray_record, normal, 56);
CONTACTD_AT(contactd_ray_record, face, 80);
CONTACTD_AT(contactd_ray_record, faces, 84);
CONTACTD_AT(contactd_ray_record, cells, 96);
CONTACTD_SIZE(contactd_distance, 80);
CONTACTD_AT(contactd_distance, lower, 0);
CONTACTD_AT(contactd_distance, upper, 8);
CONTACTD_AT(contactd_distance, point_a, 16);
CONTACTD_AT(contactd_distance, point_b, 40);
CONTACTD_AT(contactd_distance, cells, 64);
CONTACTD_AT(contactd_distance, settled, 72);
CONTACTD_AT(contactd_distance, reserved, 76);
CONTACTD_SIZE(contactd_names, 16);
CONTACTD_AT(contactd_names, a, 0);
CONTACTD_AT(contactd_names, b, 8);
CONTACTD_SIZE(contactd_object, 152);
CONTACTD_AT(contactd_object, name, 0);
CONTACTD_AT(contactd_object, group, 8);
CONTACTD_AT(contactd_object, model, 16);
CONTACTD_AT(contactd_object, is_static, 20);
CONTACTD_AT(contactd_object, rotates, 24);
CONTACTD_AT(contactd_object, reserved, 28);
CONTACTD_AT(contactd_object, max_speed, 32);
CONTACTD_AT(contactd_object, place, 40);
CONTACTD_AT(contactd_object, pose, 96);
CONTACTD_SIZE(contactd_joint_value, 16);
CONTACTD_AT(contactd_joint_value, name, 0);
CONTACTD_AT(contactd_joint_value, value, 8);
CONTACTD_SIZE(contactd_scene_options, 64);
CONTACTD_AT(contactd_scene_options, joints, 0);
CONTACTD_AT(contactd_scene_options, joint_count, 8);
CONTACTD_AT(contactd_scene_options, key, 16);
CONTACTD_AT(contactd_scene_options, packages, 24);
CONTACTD_AT(contactd_scene_options, package_count, 32);
CONTACTD_AT(contactd_scene_options, srdf, 40);
CONTACTD_AT(contactd_scene_options, import_root, 48);
CONTACTD_AT(contactd_scene_options, hulls, 56);
CONTACTD_AT(contactd_scene_options, keeps_rules, 60);
CONTACTD_SIZE(contactd_scene_info, 40);
CONTACTD_AT(contactd_scene_info, unit, 0);
CONTACTD_AT(contactd_scene_info, dt, 8);
CONTACTD_AT(contactd_scene_info, object_count, 16);
CONTACTD_AT(contactd_scene_info, joint_count, 24);
CONTACTD_AT(contactd_scene_info, note_count, 32);
CONTACTD_SIZE(contactd_scene_object, 16);
CONTACTD_AT(contactd_scene_object, name, 0);
CONTACTD_AT(contactd_scene_object, object, 8);
CONTACTD_AT(contactd_scene_object, model, 12);
CONTACTD_SIZE(contactd_joint, 40);
CONTACTD_AT(contactd_joint, name, 0);
CONTACTD_AT(contactd_joint, turns, 8);
CONTACTD_AT(contactd_joint, reserved, 12);
CONTACTD_AT(contactd_joint, low, 16);
CONTACTD_AT(contactd_joint, high, 24);
CONTACTD_AT(contactd_joint, value, 32);
CONTACTD_SIZE(contactd_options, 48);
CONTACTD_AT(contactd_options, advance, 0);
CONTACTD_AT(contactd_options, dt, 8);
CONTACTD_AT(contactd_options, first, 16);
CONTACTD_AT(contactd_options, details, 20);
CONTACTD_AT(contactd_options, clear, 24);
CONTACTD_AT(contactd_options, polling, 28);
CONTACTD_AT(contactd_options, max_records, 32);
CONTACTD_AT(contactd_options, cell_limit, 36);
CONTACTD_AT(contactd_options, batch_limit, 40);
CONTACTD_AT(contactd_options, reserved, 44);
CONTACTD_SIZE(contactd_reply, 264);
CONTACTD_AT(contactd_reply, header, 0);
CONTACTD_AT(contactd_reply, records, 232);
CONTACTD_AT(contactd_reply, record_count, 240);
CONTACTD_AT(contactd_reply, slots, 248);
CONTACTD_AT(contactd_reply, slot_count, 256);
CONTACTD_SIZE(contactd_manifold_point, 112);
CONTACTD_AT(contactd_manifold_point, id, 0);
CONTACTD_AT(contactd_manifold_point, group, 4);
CONTACTD_AT(contactd_manifold_point, position, 8);
CONTACTD_AT(contactd_manifold_point, normal, 32);
CONTACTD_AT(contactd_manifold_point, separation, 56);
CONTACTD_AT(contactd_manifold_point, on_a, 64);
CONTACTD_AT(contactd_manifold_point, on_b, 88);
CONTACTD_SIZE(contactd_manifold, 32);
CONTACTD_AT(contactd_manifold, a, 0);
CONTACTD_AT(contactd_manifold, b, 4);
CONTACTD_AT(contactd_manifold, status, 8);
CONTACTD_AT(contactd_manifold, is_complete, 12);
CONTACTD_AT(contactd_manifold, points, 16);
CONTACTD_AT(contactd_manifold, point_count, 24);
CONTACTD_SIZE(contactd_effect_counters, 88);
CONTACTD_AT(contactd_effect_counters, continuous, 0);
CONTACTD_AT(contactd_effect_counters, discrete, 8);
CONTACTD_AT(contactd_effect_counters, turning, 16);
CONTACTD_AT(contactd_effect_counters, times, 24);
CONTACTD_AT(contactd_effect_counters, contacts, 32);
CONTACTD_AT(contactd_effect_counters, patches, 40);
CONTACTD_AT(contactd_effect_counters, penetrations, 48);
CONTACTD_AT(contactd_effect_counters, margins, 56);
CONTACTD_AT(contactd_effect_counters, past_overlaps, 64);
CONTACTD_AT(contactd_effect_counters, sensors, 72);
CONTACTD_AT(contactd_effect_counters, clearances, 80);
CONTACTD_SIZE(contactd_rule, 72);
CONTACTD_AT(contactd_rule, between, 0);
CONTACTD_AT(contactd_rule, except, 16);
CONTACTD_AT(contactd_rule, except_count, 24);
CONTACTD_AT(contactd_rule, margin, 32);
CONTACTD_AT(contactd_rule, clearance, 40);
CONTACTD_AT(contactd_rule, detect, 48);
CONTACTD_AT(contactd_rule, report, 52);
CONTACTD_AT(contactd_rule, initial_overlap, 56);
CONTACTD_AT(contactd_rule, penetration, 60);
CONTACTD_AT(contactd_rule, sensor, 64);
#undef CONTACTD_AT
#undef CONTACTD_SIZE
#undef CONTACTD_ASSERT
