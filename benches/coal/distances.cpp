// The questions of the benchmark `distances`, asked of coal (formerly hpp-fcl).
//
//     cargo run --release -p contactd-benches --bin distances -- --export DIR
//     pip install coal; apt install libeigen3-dev
//     P=$(python3 -c 'import cmeel, pathlib; print(pathlib.Path(cmeel.__path__[0]).parent / "cmeel.prefix")')
//     g++ -O3 -DNDEBUG -std=c++17 -I$P/include -isystem /usr/include/eigen3 benches/coal/distances.cpp -o coal_distances \
//         -L$P/lib -lcoal -Wl,-rpath,$P/lib
//     ./coal_distances DIR/distances.csv
//
// coal is asked by one ComputeDistance a question, warmed up, with its default settings, and once with a tolerance of 1e-12.
// Told are medians of a pair of kinds: our microseconds (as the benchmark measured them), coal's, their ratio, and how far coal's
// distance lies outside of our bounds at most, in the pair's size.

#include <coal/distance.h>
#include <coal/shape/convex.h>
#include <coal/shape/geometric_shapes.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

using coal::Vec3s;
using Clock = std::chrono::steady_clock;

static std::vector<std::string> fields(const std::string &line) {
    std::vector<std::string> all;
    std::stringstream rest(line);
    for (std::string field; std::getline(rest, field, ',');) all.push_back(field);
    return all;
}

static std::vector<double> numbers(const std::string &text) {
    std::vector<double> all;
    std::stringstream rest(text);
    for (double x; rest >> x;) all.push_back(x);
    return all;
}

// A body by its words: its kind, then its lengths. Half sizes become coal's whole ones.
static std::shared_ptr<coal::CollisionGeometry> shape(const std::string &words, std::string &kind) {
    std::stringstream rest(words);
    rest >> kind;
    std::string left;
    std::getline(rest, left);
    const std::vector<double> v = numbers(left);
    if (kind == "ball") return std::make_shared<coal::Sphere>(v[0]);
    if (kind == "box") return std::make_shared<coal::Box>(2 * v[0], 2 * v[1], 2 * v[2]);
    if (kind == "capsule") return std::make_shared<coal::Capsule>(v[1], 2 * v[0]);
    if (kind == "cylinder") return std::make_shared<coal::Cylinder>(v[1], 2 * v[0]);
    if (kind == "cone") return std::make_shared<coal::Cone>(v[1], 2 * v[0]);
    if (kind == "ellipsoid") return std::make_shared<coal::Ellipsoid>(v[0], v[1], v[2]);
    auto points = std::make_shared<std::vector<Vec3s>>();
    for (size_t i = 0; i + 2 < v.size(); i += 3) points->emplace_back(v[i], v[i + 1], v[i + 2]);
    return std::shared_ptr<coal::CollisionGeometry>(
        coal::ConvexBase::convexHull(points, static_cast<unsigned>(points->size()), true));
}

static coal::Transform3s pose(const std::string &text) {
    const std::vector<double> v = numbers(text);
    const Eigen::Quaterniond turn(v[6], v[3], v[4], v[5]);
    return coal::Transform3s(turn.toRotationMatrix(), Vec3s(v[0], v[1], v[2]));
}

static double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v.empty() ? 0 : v[v.size() / 2];
}

struct Asked {
    double distance, micros;
};

static Asked ask(const coal::CollisionGeometry &a, const coal::Transform3s &at_a, const coal::CollisionGeometry &b,
                 const coal::Transform3s &at_b, double tolerance) {
    const coal::ComputeDistance compute(&a, &b);
    coal::DistanceRequest request;
    request.enable_signed_distance = false;
    if (tolerance > 0) {
        request.gjk_tolerance = tolerance;
        request.gjk_max_iterations = 1000;
    }
    double distance = 0;
    std::vector<double> blocks;
    for (int block = 0; block < 9; ++block) {
        const int times = 20;
        const auto begun = Clock::now();
        for (int k = 0; k < times; ++k) {
            coal::DistanceResult result;
            distance = compute(at_a, at_b, request, result);
        }
        blocks.push_back(std::chrono::duration<double, std::micro>(Clock::now() - begun).count() / times);
    }
    return {distance, median(blocks)};
}

int main(int count, char **arguments) {
    std::ifstream file(count > 1 ? arguments[1] : "");
    std::string line;
    if (!std::getline(file, line)) {
        std::cerr << "usage: coal_distances DIR/distances.csv, as `distances --export DIR` has written it\n";
        return 1;
    }
    struct Row {
        std::vector<double> own, fast, ratio, exact, exact_ratio;
        double off = 0, exact_off = 0;
    };
    std::map<std::string, Row> rows;
    std::vector<std::string> order;
    while (std::getline(file, line)) {
        const std::vector<std::string> f = fields(line);
        std::string kind_a, kind_b;
        const auto a = shape(f[0], kind_a), b = shape(f[1], kind_b);
        const auto at_a = pose(f[2]), at_b = pose(f[3]);
        const double size = std::stod(f[4]), lower = std::stod(f[5]), upper = std::stod(f[6]), own = std::stod(f[7]);
        const std::string name = kind_a + "-" + kind_b;
        if (!rows.count(name)) order.push_back(name);
        Row &row = rows[name];
        const Asked fast = ask(*a, at_a, *b, at_b, 0), exact = ask(*a, at_a, *b, at_b, 1e-12);
        const auto off = [&](double d) { return std::max({0.0, lower - d, d - upper}) / size; };
        row.own.push_back(own);
        row.fast.push_back(fast.micros);
        row.ratio.push_back(own / fast.micros);
        row.exact.push_back(exact.micros);
        row.exact_ratio.push_back(own / exact.micros);
        row.off = std::max(row.off, off(fast.distance));
        row.exact_off = std::max(row.exact_off, off(exact.distance));
    }
    std::printf("%-20s %5s %8s %8s %7s %8s %9s %7s %8s\n", "pair", "cases", "own_us", "coal_us", "ratio", "off", "coal12_us",
                "ratio", "off");
    for (const std::string &name : order) {
        const Row &row = rows[name];
        std::printf("%-20s %5zu %8.2f %8.2f %7.2f %8.1e %9.2f %7.2f %8.1e\n", name.c_str(), row.own.size(), median(row.own),
                    median(row.fast), median(row.ratio), row.off, median(row.exact), median(row.exact_ratio), row.exact_off);
    }
}
