// The shortest useful client: a ball falls on a drilled plate. hello [--embedded] [SERVER]: with an engine of its own, or on a
// server that runs (contactd serve). The same in Rust: server/examples/hello.rs.
#include <contactd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *PLATE =
    "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }";
static const char *BALL = "sphere(r = 5);";

static void check(int32_t code) {
    if (code != CONTACTD_OK) {
        fprintf(stderr, "hello: %s (code %d)\n", contactd_error_message(), code);
        exit(1);
    }
}

int main(int argc, char **argv) {
    const char *server = NULL;
    int embedded = 0;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--embedded") == 0) {
            embedded = 1;
        } else {
            server = argv[i];
        }
    }
    contactd_session *session;
    check(embedded ? contactd_embedded(NULL, &session) : contactd_connect(server, &session));

    uint32_t plate_model, ball_model, plate, ball;
    check(contactd_load_model(session, "plate.csg", PLATE, CONTACTD_FACETS_AUTO, &plate_model));
    check(contactd_load_model(session, "ball.csg", BALL, CONTACTD_FACETS_AUTO, &ball_model));
    contactd_object object = contactd_object_new("plate", plate_model);
    object.is_static = 1;
    check(contactd_add_object(session, &object, &plate));
    object = contactd_object_new("ball", ball_model);
    object.pose.position[0] = 1.0;
    object.pose.position[2] = 20.0;
    check(contactd_add_object(session, &object, &ball));

    contactd_pose_record *poses;
    contactd_reply reply;
    check(contactd_begin_step(session, 1, &poses));
    poses[0] = (contactd_pose_record){
        .object = ball, .flags = CONTACTD_END, .position = {1.0, 0.0, 0.0}, .rotation = {0.0, 0.0, 0.0, 1.0}};
    check(contactd_finish(session, 5.0, &reply));
    for (size_t i = 0; i < reply.record_count; i++) {
        const contactd_record *c = &reply.records[i];
        const double *p = c->point, *n = c->normal;
        printf("%u-%u: contact at t = %.15f, ", c->a, c->b, c->time);
        printf("point %.12f %.12f %.12f, normal %.12f %.12f %.12f\n", p[0], p[1], p[2], n[0], n[1], n[2]);
    }
    check(contactd_close(&session));
    return 0;
}
