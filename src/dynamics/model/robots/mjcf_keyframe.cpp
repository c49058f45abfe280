// Where a robot of MJCF begins.
#include <algorithm>

#include "dynamics/model/robots/mjcf.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {

void read_mjcf_keyframe(const MjcfText& text, const RobotOptions& options, Robot& robot) {
  std::vector<Element> keys;
  for (const Element& section : text.sections("keyframe"))
    for (const Element& e : text.children(section)) keys.push_back(e);
  if (options.keyframe.empty()) return;
  const auto number = numbers_of(options.keyframe);
  auto it =
      std::find_if(keys.begin(), keys.end(), [&](const Element& e) { return e.text("name") == options.keyframe; });
  if (it == keys.end() && number && number->size() == 1 && (*number)[0] >= 0 &&
      (*number)[0] < static_cast<double>(keys.size()))
    it = keys.begin() + static_cast<std::ptrdiff_t>((*number)[0]);
  if (it == keys.end()) {
    std::string known;
    for (const Element& e : keys) known += (known.empty() ? "" : ", ") + (e.has("name") ? e.text("name") : "(no name)");
    throw Error(StatusCode::invalid_input, text.root().file->name() + ": there is no keyframe '" + options.keyframe +
                                               "'; known are " + (known.empty() ? "none" : known));
  }
  constexpr std::size_t kMost = 10'000'000;
  const std::vector<double> q = it->numbers("qpos", 0, kMost), v = it->numbers("qvel", 0, kMost),
                            u = it->numbers("ctrl", 0, kMost);
  std::size_t nq = 0, nv = 0;
  for (Link& link : robot.links)
    for (RobotJoint& j : link.joints) {
      const bool ball = j.kind == JointKind::ball, free = j.kind == JointKind::free;
      const std::size_t of_q = free ? 7 : ball ? 4 : 1, of_v = free ? 6 : ball ? 3 : 1;
      if (!q.empty() && nq + of_q > q.size()) it->fail("'qpos' has too few numbers, " + std::to_string(q.size()));
      if (!v.empty() && nv + of_v > v.size()) it->fail("'qvel' has too few numbers, " + std::to_string(v.size()));
      Pose start = free ? link.pose : Pose{};
      if (!q.empty()) {
        const double* x = q.data() + nq;
        if (free) start.p = Vec3(x[0], x[1], x[2]);
        if (free || ball) {
          const double* w = x + (free ? 3 : 0);
          if (w[0] != 0 || w[1] != 0 || w[2] != 0 || w[3] != 0) start.r = of_quaternion(w[0], w[1], w[2], w[3]);
        } else {
          j.start = x[0];
        }
      }
      if (!v.empty()) {
        const double* x = v.data() + nv;
        if (free) j.start_velocity = Vec3(x[0], x[1], x[2]);
        if (free || ball)
          j.start_spin = Eigen::Map<const Vec3>(x + (free ? 3 : 0));
        else
          j.speed = x[0];
      }
      if (free || ball) j.start_pose = start;
      nq += of_q, nv += of_v;
    }
  if ((!q.empty() && nq != q.size()) || (!v.empty() && nv != v.size()))
    it->fail("'qpos' and 'qvel' need " + std::to_string(nq) + " and " + std::to_string(nv) + " numbers");
  if (!u.empty() && u.size() != robot.actuators.size())
    it->fail("'ctrl' needs " + std::to_string(robot.actuators.size()) + " numbers");
  for (std::size_t k = 0; k < u.size(); ++k) robot.actuators[k].start = u[k];
}

}  // namespace espalier::dynamics::model::robots
