// OMPL on one of our scenes: RRT-Connect with its path simplifier (a polyline, no headings), and BIT* with Dubins curves.
//
//     compare scene.json turning_radius_m resolution_m exact_length_m runs
//
// Processor time of the thread. States are valid off all polygons and inside the field, tested exactly; motions are sampled
// at the resolution. Prints rows of a Markdown table: scene, planner, runs that found something, ms, length / exact. Each run of
// BIT* is a process of its own, with its own seed: assertions in the Dubins space of Debian's build may end it, which is counted.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include <boost/property_tree/json_parser.hpp>
#include <boost/property_tree/ptree.hpp>

#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/DubinsStateSpace.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

#if __has_include(<ompl/geometric/planners/informedtrees/BITstar.h>)
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#else
#include <ompl/geometric/planners/bitstar/BITstar.h>
#endif

namespace ob = ompl::base;
namespace og = ompl::geometric;

namespace {

double cpuSeconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Point {
    double x, y;
};

using Polygon = std::vector<Point>;

// The polygons of a scene, filed under the squares of a grid that their boxes touch.
class Scene {
public:
    explicit Scene(const std::string &file) {
        boost::property_tree::ptree json;
        boost::property_tree::read_json(file, json);
        width = json.get<double>("width");
        height = json.get<double>("height");
        start = numbers(json.get_child("start"));
        goal = numbers(json.get_child("goal"));
        squares_.resize(kSide * kSide);
        for (const auto &obstacle : json.get_child("obstacles")) {
            Polygon polygon;
            for (const auto &vertex : obstacle.second.get_child("polygon")) {
                const auto p = numbers(vertex.second);
                polygon.push_back({p.at(0), p.at(1)});
            }
            file_under_squares(polygon);
            polygons_.push_back(std::move(polygon));
        }
    }

    bool isFree(double x, double y) const {
        if (!(x > 0.0 && y > 0.0 && x < width && y < height)) return false;
        const auto &here = squares_[square(y, height) * kSide + square(x, width)];
        return std::none_of(here.begin(), here.end(),
                            [&](std::size_t i) { return contains(polygons_[i], x, y); });
    }

    double width = 0.0, height = 0.0;
    std::vector<double> start, goal;

private:
    static constexpr std::size_t kSide = 128;

    static std::vector<double> numbers(const boost::property_tree::ptree &array) {
        std::vector<double> values;
        for (const auto &item : array) values.push_back(item.second.get_value<double>());
        return values;
    }

    static std::size_t square(double at, double extent) {
        const double index = std::floor(at / extent * static_cast<double>(kSide));
        return static_cast<std::size_t>(std::clamp(index, 0.0, static_cast<double>(kSide - 1)));
    }

    void file_under_squares(const Polygon &polygon) {
        Point low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};
        for (const auto &p : polygon) {
            low = {std::min(low.x, p.x), std::min(low.y, p.y)};
            high = {std::max(high.x, p.x), std::max(high.y, p.y)};
        }
        for (auto row = square(low.y, height); row <= square(high.y, height); ++row)
            for (auto column = square(low.x, width); column <= square(high.x, width); ++column)
                squares_[row * kSide + column].push_back(polygons_.size());
    }

    static bool contains(const Polygon &polygon, double x, double y) {
        bool inside = false;
        for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
            const Point a = polygon[i], b = polygon[j];
            if ((a.y > y) != (b.y > y) && x < a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
                inside = !inside;
        }
        return inside;
    }

    std::vector<Polygon> polygons_;
    std::vector<std::vector<std::size_t>> squares_;
};

// What one run came to: ms and length in exact lengths, of the first path and of the last; not finite where there was none.
struct Result {
    double firstTime = INFINITY, firstRatio = INFINITY, time = INFINITY, ratio = INFINITY;
};

// The results of `runs` runs, each in a child; those that were aborted are missing.
std::vector<Result> isolated(int runs, const std::function<Result()> &run) {
    std::vector<Result> results;
    for (int i = 0; i < runs; ++i) {
        int ends[2];
        if (pipe(ends) != 0) std::abort();
        const pid_t child = fork();
        if (child < 0) std::abort();
        if (child == 0) {
            // What the assertion prints is told by the count.
            if (std::freopen("/dev/null", "w", stderr) == nullptr) _exit(1);
            ompl::RNG::setSeed(static_cast<unsigned>(i + 1));
            const Result result = run();
            const bool sent = write(ends[1], &result, sizeof result) == sizeof result;
            _exit(sent ? 0 : 1);
        }
        close(ends[1]);
        Result result;
        if (read(ends[0], &result, sizeof result) == sizeof result) results.push_back(result);
        close(ends[0]);
        waitpid(child, nullptr, 0);
    }
    return results;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

void row(const std::string &scene, const char *planner, int runs, const std::vector<Result> &results,
         double Result::*time, double Result::*ratio) {
    std::vector<double> times, ratios;
    for (const auto &result : results)
        if (std::isfinite(result.*ratio)) {
            times.push_back(result.*time);
            ratios.push_back(result.*ratio);
        }
    const int aborted = runs - static_cast<int>(results.size());
    std::printf("| %s | %s | %zu/%d | %d | ", scene.c_str(), planner, ratios.size(), runs, aborted);
    if (ratios.empty())
        std::printf("– | – |\n");
    else
        std::printf("%.2f | %.4f |\n", median(times), median(ratios));
    std::fflush(stdout);
}

ob::RealVectorBounds boundsOf(const Scene &scene) {
    ob::RealVectorBounds bounds(2);
    bounds.setLow(0.0);
    bounds.setHigh(0, scene.width);
    bounds.setHigh(1, scene.height);
    return bounds;
}

void polyline(const Scene &scene, const std::string &name, double resolution, double exact, int runs) {
    auto space = std::make_shared<ob::RealVectorStateSpace>(2);
    space->setBounds(boundsOf(scene));
    auto si = std::make_shared<ob::SpaceInformation>(space);
    si->setStateValidityChecker([&scene](const ob::State *state) {
        const auto *p = state->as<ob::RealVectorStateSpace::StateType>();
        return scene.isFree(p->values[0], p->values[1]);
    });
    si->setStateValidityCheckingResolution(resolution / space->getMaximumExtent());
    si->setup();
    ob::ScopedState<ob::RealVectorStateSpace> start(space), goal(space);
    for (unsigned axis = 0; axis < 2; ++axis) {
        start[axis] = scene.start[axis];
        goal[axis] = scene.goal[axis];
    }
    const auto run = [&] {
        Result result;
        auto problem = std::make_shared<ob::ProblemDefinition>(si);
        problem->setStartAndGoalStates(start, goal);
        og::RRTConnect planner(si);
        planner.setProblemDefinition(problem);
        const double since = cpuSeconds();
        planner.setup();
        if (planner.solve(ob::PlannerTerminationCondition([since] { return cpuSeconds() - since > 1.0; })) !=
            ob::PlannerStatus::EXACT_SOLUTION)
            return result;
        result.firstTime = 1e3 * (cpuSeconds() - since);
        auto *path = problem->getSolutionPath()->as<og::PathGeometric>();
        result.firstRatio = path->length() / exact;
        og::PathSimplifier(si).simplifyMax(*path);
        result.time = 1e3 * (cpuSeconds() - since);
        result.ratio = path->length() / exact;
        return result;
    };
    // All in this process: in a fresh one a millisecond's search pays for its first touch of memory.
    std::vector<Result> results;
    for (int i = 0; i < runs; ++i) results.push_back(run());
    row(name, "RRT-Connect, polyline", runs, results, &Result::firstTime, &Result::firstRatio);
    row(name, "RRT-Connect + simplify, polyline", runs, results, &Result::time, &Result::ratio);
}

void dubins(const Scene &scene, const std::string &name, double radius, double resolution, double exact, int runs) {
    auto space = std::make_shared<ob::DubinsStateSpace>(radius);
    space->setBounds(boundsOf(scene));
    auto si = std::make_shared<ob::SpaceInformation>(space);
    si->setStateValidityChecker([&scene](const ob::State *state) {
        const auto *p = state->as<ob::SE2StateSpace::StateType>();
        return scene.isFree(p->getX(), p->getY());
    });
    si->setMotionValidator(std::make_shared<ob::DubinsMotionValidator>(si));
    si->setStateValidityCheckingResolution(resolution / space->getMaximumExtent());
    si->setup();
    ob::ScopedState<ob::DubinsStateSpace> start(space), goal(space);
    const auto set = [](ob::ScopedState<ob::DubinsStateSpace> &state, const std::vector<double> &pose) {
        state->setXY(pose.at(0), pose.at(1));
        state->setYaw(std::remainder(pose.at(2) * M_PI / 180.0, 2.0 * M_PI));
    };
    set(start, scene.start);
    set(goal, scene.goal);
    for (const double seconds : {0.3, 1.0}) {
        const auto results = isolated(runs, [&] {
            Result result;
            auto problem = std::make_shared<ob::ProblemDefinition>(si);
            problem->setStartAndGoalStates(start, goal);
            problem->setOptimizationObjective(std::make_shared<ob::PathLengthOptimizationObjective>(si));
            const double since = cpuSeconds();
            problem->setIntermediateSolutionCallback(
                [&](const ob::Planner *, const std::vector<const ob::State *> &, const ob::Cost) {
                    if (!std::isfinite(result.time)) result.time = 1e3 * (cpuSeconds() - since);
                });
            og::BITstar planner(si);
            planner.setProblemDefinition(problem);
            planner.setup();
            planner.solve(ob::PlannerTerminationCondition(
                [since, seconds] { return cpuSeconds() - since > seconds; }));
            if (problem->hasExactSolution()) result.ratio = problem->getSolutionPath()->length() / exact;
            return result;
        });
        const std::string label = "BIT*, Dubins, " + std::string(seconds < 0.5 ? "0.3" : "1") + " s (ms: first)";
        row(name, label.c_str(), runs, results, &Result::time, &Result::ratio);
    }
}

}  // namespace

int main(int count, char **arguments) {
    if (count != 6) {
        std::fprintf(stderr, "usage: compare scene.json turning_radius_m resolution_m exact_length_m runs\n");
        return 2;
    }
    ompl::msg::setLogLevel(ompl::msg::LOG_NONE);
    const std::string file = arguments[1];
    const double radius = std::atof(arguments[2]), resolution = std::atof(arguments[3]);
    const double exact = std::atof(arguments[4]);
    const int runs = std::max(1, std::atoi(arguments[5]));
    const auto slash = file.find_last_of('/') + 1;
    const std::string name = file.substr(slash, file.find_last_of('.') - slash);
    try {
        const Scene scene(file);
        // First, while no generator of random numbers has been made that a child's seed would come too late for.
        dubins(scene, name, radius, resolution, exact, runs);
        ompl::RNG::setSeed(1);
        polyline(scene, name, resolution, exact, 4 * runs);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s: %s\n", file.c_str(), error.what());
        return 1;
    }
    return 0;
}
