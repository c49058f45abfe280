/// \file
/// What the kinds of joints are made of: rows, and joints of two frames.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics::joint_rows {

inline JointRow row(std::string label, JointRow::Term term, double offset = 0) {
  JointRow r;
  r.label = std::move(label);
  r.terms = {std::move(term)};
  r.offset = offset;
  return r;
}

/// A sum that keeps the value which it has at the first evaluation.
inline JointRow coupling(std::vector<JointRow::Term> terms) {
  JointRow r;
  r.label = "coupling";
  r.terms = std::move(terms);
  r.measure_offset = true;
  return r;
}

/// Origins coincide: three equations in global axes, which have constant gradients at the frames.
inline void add_coincidence(std::vector<JointRow>& rows) {
  for (const int i : {0, 1, 2}) {
    rows.push_back(row(std::string("translation along global ") + "xyz" [i], { Relative::global, i }));
  }
}

/// z axes parallel: x_A . z_B = 0 stops the rotation about y, y_A . z_B = 0 the one about x.
inline void add_parallel(std::vector<JointRow>& rows) {
  rows.push_back(row("rotation about y", {Relative::dot, 0, 2}));
  rows.push_back(row("rotation about x", {Relative::dot, 1, 2}));
}

inline std::unique_ptr<Joint> make(const char* kind, std::string name, FramePtr a, FramePtr b,
                                   std::vector<JointRow> rows) {
  std::vector<FramePtr> frames;
  frames.push_back(std::move(a));
  frames.push_back(std::move(b));
  return std::make_unique<Joint>(kind, std::move(name), std::move(frames), std::move(rows));
}

/// Joints about whose z axis something turns: the angle is a quantity, with its turns.
inline std::unique_ptr<Joint> counted(std::unique_ptr<Joint> joint) {
  joint->count_turns();
  return joint;
}

}  // namespace espalier::dynamics::joint_rows
