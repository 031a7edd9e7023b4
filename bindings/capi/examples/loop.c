// A loop of one's own: a ball flies from contact to contact in a room with a pillar. The same in Rust:
// server/examples/own_loop.rs. To be compiled without contraction (-ffp-contract=off) for the same digits.
#include <contactd.h>
#include <stdio.h>
#include <stdlib.h>

static const char *ROOM =
    "union() {\n"
    "    difference() { cube(size = [12, 12, 12], center = true); cube(size = [10, 10, 10], center = true); }\n"
    "    cylinder(h = 11, r1 = 1.5, r2 = 1.5, center = true);\n"
    "}";
static const double STEP = 0.25;

static void check(int32_t code) {
    if (code != CONTACTD_OK) {
        fprintf(stderr, "loop: %s (code %d)\n", contactd_error_message(), code);
        exit(1);
    }
}

int main(void) {
    contactd_session *session;
    check(contactd_embedded(NULL, &session)); // or contactd_connect("default", &session)
    contactd_options options;
    check(contactd_get_options(session, &options));
    options.first = 1;
    check(contactd_set_options(session, &options));
    uint32_t room_model, ball_model, room, ball;
    check(contactd_load_model(session, "room.csg", ROOM, CONTACTD_FACETS_AUTO, &room_model));
    check(contactd_load_model(session, "ball.csg", "sphere(r = 1);", CONTACTD_FACETS_AUTO, &ball_model));
    double x[3] = {-3.0, -2.5, 1.0}, v[3] = {2.0, 1.25, 0.75};
    contactd_object object = contactd_object_new("room", room_model);
    object.is_static = 1;
    check(contactd_add_object(session, &object, &room));
    object = contactd_object_new("ball", ball_model);
    for (int k = 0; k < 3; k++) object.pose.position[k] = x[k];
    check(contactd_add_object(session, &object, &ball));

    double time = 0.0, taken = 1.0;
    while (time < 20.0) {
        contactd_pose_record *poses;
        contactd_reply reply;
        check(contactd_set_advance(session, taken)); // of the step before
        check(contactd_begin_step(session, 1, &poses));
        poses[0] = (contactd_pose_record){.object = ball, .flags = CONTACTD_END, .rotation = {0.0, 0.0, 0.0, 1.0}};
        for (int k = 0; k < 3; k++) poses[0].position[k] = x[k] + v[k] * STEP;
        check(contactd_finish(session, 5.0, &reply));
        int hit = reply.record_count > 0 && reply.records[0].status == CONTACTD_CONTACT;
        taken = hit ? reply.records[0].time : reply.header.safe_time;
        time += taken * STEP;
        for (int k = 0; k < 3; k++) x[k] += v[k] * (taken * STEP);
        if (hit) {
            const double *n = reply.records[0].normal; // from the room to the ball
            double twice = 2.0 * (v[0] * n[0] + v[1] * n[1] + v[2] * n[2]);
            for (int k = 0; k < 3; k++) v[k] -= n[k] * twice;
            printf("t = %.12f: at %.12f %.12f %.12f\n", time, x[0], x[1], x[2]);
        }
    }
    check(contactd_close(&session));
    return 0;
}
