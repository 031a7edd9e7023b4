// Few contact points that stay: a cube that slides on a floor, its points at two steps as MuJoCo's contacts. The same in Rust:
// server/examples/manifold.rs.
#include <contactd.h>
#include <stdio.h>
#include <stdlib.h>

static const char *FLOOR = "cube(size = [40, 40, 4], center = true);";
static const char *CUBE = "cube(size = [4, 4, 4], center = true);";

static void check(int32_t code) {
    if (code != CONTACTD_OK) {
        fprintf(stderr, "manifold: %s (code %d)\n", contactd_error_message(), code);
        exit(1);
    }
}

int main(void) {
    contactd_session *session;
    contactd_manifolds *manifolds;
    check(contactd_embedded(NULL, &session));
    check(contactd_manifolds_new(&manifolds));
    uint32_t ground_model, cube_model, ground, cube;
    check(contactd_load_model(session, "floor.csg", FLOOR, CONTACTD_FACETS_AUTO, &ground_model));
    check(contactd_load_model(session, "cube.csg", CUBE, CONTACTD_FACETS_AUTO, &cube_model));
    contactd_object object = contactd_object_new("floor", ground_model);
    object.is_static = 1;
    check(contactd_add_object(session, &object, &ground));
    object = contactd_object_new("cube", cube_model);
    object.pose.position[2] = 9.0;
    check(contactd_add_object(session, &object, &cube));
    contactd_rule rule = contactd_rule_new("default", "default");
    rule.report = CONTACTD_REPORT_PATCH;
    rule.margin = 0.01; // the cube rests a thousandth above the floor
    check(contactd_set_rules(session, &rule, 1));

    for (int step = 0; step < 2; step++) {
        contactd_pose_record *slot;
        contactd_reply reply;
        check(contactd_begin_step(session, 1, &slot));
        *slot = (contactd_pose_record){
            .object = cube, .flags = CONTACTD_START, .position = {0.5 * step, 0.25, 4.001}, .rotation = {0.0, 0.0, 0.0, 1.0}};
        // Of the reply's one record: where a (the floor) and b (the cube) stand.
        contactd_pose poses[2] = {{.rotation = {0.0, 0.0, 0.0, 1.0}}, {.rotation = {0.0, 0.0, 0.0, 1.0}}};
        for (int k = 0; k < 3; k++) poses[1].position[k] = slot->position[k];
        check(contactd_finish(session, 5.0, &reply));
        check(contactd_manifolds_update(manifolds, &reply, poses, 2));
        contactd_manifold pair;
        check(contactd_manifolds_find(manifolds, ground, cube, &pair));
        for (size_t i = 0; i < pair.point_count; i++) {
            const contactd_manifold_point *p = &pair.points[i];
            double pos[3], frame[9], dist;
            check(contactd_contact_to_mujoco(p->position, p->normal, p->separation, pos, frame, &dist));
            printf("step %d, point %u: pos %.12f %.12f %.12f, ", step, p->id, pos[0], pos[1], pos[2]);
            printf("normal %.12f %.12f %.12f, dist %.12f\n", frame[0], frame[1], frame[2], dist);
        }
    }
    check(contactd_manifolds_free(&manifolds));
    check(contactd_close(&session));
    return 0;
}
