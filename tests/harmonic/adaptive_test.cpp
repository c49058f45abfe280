// Interpolated frequency responses against dense solutions, and peaks that no grid would see.
#include <fmt/format.h>

#include "harmonic/harmonic_common.hpp"
#include "harmonic/rational.hpp"

namespace espalier {
namespace {

using test::Complex;
using test::kI;
using test::kTwoPi;
using test::range;
using test::sparse;

// Truth: a rational function of degree (3, 3) is found exactly, with its poles.
TEST(Rational, FindsARationalFunctionAndItsPoles) {
  const std::vector<Complex> poles = {{0.3, 1e-3}, {0.7, 0.05}, {-0.4, 0.2}};
  const auto exact = [&](double s) {
    Complex y = 1;
    for (const Complex& p : poles) y += 0.1 / (s - p);
    return y;
  };
  std::vector<double> s;
  Eigen::MatrixXcd y(2, 15);
  for (int i = 0; i < 15; ++i) {
    s.push_back(i / 14.0);
    y(0, i) = exact(s.back());
    y(1, i) = 2.0 * y(0, i) + 1.0 / (s.back() - poles[0]);
  }
  harmonic::Rational r;
  r.fit(s, y, y.cwiseAbs(), 1e-12);
  EXPECT_EQ(r.support().size(), 4U);
  EXPECT_LE(r.error(), 1e-12);
  for (const double at : {0.3, 0.01, 0.5, 0.7001}) EXPECT_LE(std::abs(r.evaluate(at)[0] - exact(at)), 1e-9) << at;
  const std::vector<Complex> found = r.poles();
  ASSERT_EQ(found.size(), 3U);
  for (const Complex& p : poles) {
    double nearest = INFINITY;
    for (const Complex& q : found) nearest = std::min(nearest, std::abs(p - q));
    EXPECT_LE(nearest, 1e-9) << p;
  }
}

// Truth: 60 poles, more than a singular value decomposition is made for.
TEST(Rational, FindsManyPoles) {
  constexpr int kPoles = 60, kSamples = 5 * kPoles;
  std::vector<Complex> poles;
  for (int k = 0; k < kPoles; ++k) poles.emplace_back((k + 0.5) / kPoles, 0.002 + 1e-4 * (k % 7));
  const auto exact = [&](double s) {
    Complex y = 1;
    for (const Complex& p : poles) y += 0.01 / (s - p);
    return y;
  };
  std::vector<double> s;
  Eigen::MatrixXcd y(1, kSamples);
  for (int i = 0; i < kSamples; ++i) {
    s.push_back(i / (kSamples - 1.0));
    y(0, i) = exact(s.back());
  }
  harmonic::Rational r;
  r.fit(s, y, y.cwiseAbs(), 1e-10);
  EXPECT_GT(r.support().size(), 32U);
  EXPECT_LE(r.support().size(), kPoles + 4U);
  EXPECT_LE(r.error(), 1e-10);
  for (int i = 0; i + 1 < kSamples; ++i) {
    const double at = (s[static_cast<std::size_t>(i)] + s[static_cast<std::size_t>(i) + 1]) / 2;
    EXPECT_LE(std::abs(r.evaluate(at)[0] - exact(at)), 1e-7 * std::abs(exact(at))) << at;
  }
  for (const Complex& p : poles) {
    double nearest = INFINITY;
    for (const Complex& q : r.poles()) nearest = std::min(nearest, std::abs(p - q));
    EXPECT_LE(nearest, 1e-7) << p;
  }
}

struct Case {
  Eigen::MatrixXd k, c, m;
  Eigen::MatrixXcd f;
  double eta = 0;
  [[nodiscard]] HarmonicResult response(const HarmonicOptions& o) const {
    return harmonic_response(sparse(k), sparse(c), sparse(m), test::flat(f), static_cast<Index>(f.cols()), o);
  }
  [[nodiscard]] std::function<Eigen::MatrixXcd(double)> truth() const {
    return [this](double frequency) { return test::dense_response(k, c, m, eta, f, frequency); };
  }
};

Case chain_case(int n, double damping) {
  Case a{test::chain(n), {}, Eigen::MatrixXd::Identity(n, n), Eigen::MatrixXcd::Zero(n, 2)};
  a.c = damping * a.k;
  a.f(0, 0) = 1;
  a.f(n / 3, 1) = {0, 2};
  return a;
}

// Truth: the dense answer at every point, those between the solves too. Twelve resonances, peaks of 1e3.
TEST(HarmonicInterpolation, IsGoodToTheTolerance) {
  const Case a = chain_case(12, 1e-3);
  for (const double tolerance : {1e-2, 1e-4, 1e-7}) {
    const HarmonicResult r = a.response(range(0.001, 0.35, 2001, tolerance));
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_TRUE(r.complete) << r.completeness;
    EXPECT_EQ(r.resonances.size(), 12U);
    EXPECT_GE(r.points.size(), 2001U);
    EXPECT_LE(test::worst_error(r, a.truth()), 2 * tolerance);
    EXPECT_LE(r.factorizations, 150);
    EXPECT_GE(r.checks, 4);
    EXPECT_LE(r.checked_error, tolerance);
  }
}

// The highest peak at every resonance is drawn, although it is a millionth of the spacing of points wide. Truth: the
// closed form of the modes, x_j = sin(j i pi / (n + 1)), with damping beta K.
TEST(HarmonicInterpolation, SharpResonancesAreNeverMissed) {
  constexpr int n = 8;
  for (const double damping : {1e-5, 1e-7}) {
    const Case a = chain_case(n, damping);
    HarmonicOptions o = range(0.01, 0.33, 20, 1e-3);
    o.observed = {0};
    const HarmonicResult r = a.response(o);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.resonances.size(), static_cast<std::size_t>(n));
    for (int j = 1; j <= n; ++j) {
      const double angle = j * std::numbers::pi / (n + 1), w = 2 * std::sin(angle / 2);
      const HarmonicResonance& found = r.resonances[static_cast<std::size_t>(j) - 1];
      EXPECT_NEAR(found.frequency * kTwoPi, w, 1e-9);
      EXPECT_NEAR(found.half_width * kTwoPi / (damping * w * w / 2), 1, 1e-3);
      EXPECT_TRUE(found.excited);
      const double height = 2.0 / (n + 1) * std::pow(std::sin(angle), 2) / (damping * w * w * w);
      double highest = 0;
      for (std::size_t i = 0; i < r.points.size(); ++i)
        if (std::abs(r.points[i].frequency * kTwoPi - w) < 1e-3)
          highest = std::max(highest, std::abs(r.response(i, 0, 0)));
      EXPECT_NEAR(highest / height, 1, 0.01) << j;
    }
  }
}

// A light oscillator that hangs on a heavy, well damped one by a weak spring: its peak in the response of the heavy one
// is 1e-7 of the range wide. Without the search for resonances nothing is seen; with it the peak is there. Truth: the
// dense answer in the peak.
TEST(HarmonicInterpolation, AWeaklyCoupledOscillatorIsSeen) {
  Case a;
  a.k = a.c = a.m = Eigen::MatrixXd::Zero(2, 2);
  const double mass = 1e-8, w0 = kTwoPi * 3.137, spring = mass * w0 * w0;
  a.k << 400 + spring, -spring, -spring, spring;
  a.m.diagonal() << 1, mass;
  a.c(0, 0) = 8;
  a.c(1, 1) = 2e-7 * std::sqrt(spring * mass);
  a.f = Eigen::VectorXcd::Unit(2, 0);
  HarmonicOptions o = range(0.5, 8, 50, 1e-3);
  o.observed = {0};
  const auto worst_near_the_peak = [&](const HarmonicResult& r) {
    double worst = 0;
    for (std::size_t i = 0; i < r.points.size(); ++i) {
      const Complex exact = a.truth()(r.points[i].frequency)(0, 0);
      worst = std::max(worst, std::abs(r.response(i, 0, 0) - exact) / std::abs(exact));
    }
    return worst;
  };
  const HarmonicResult r = a.response(o);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.resonances.size(), 2U);
  const HarmonicResonance& sharp = r.resonances[std::abs(r.resonances[0].frequency - 3.137) < 0.01 ? 0 : 1];
  EXPECT_TRUE(sharp.excited);
  EXPECT_LE(worst_near_the_peak(r), 2e-3);
  const auto inside = [](const HarmonicResult& found) {
    std::size_t points = 0;
    for (const HarmonicPoint& p : found.points) points += std::abs(p.frequency - 3.137) < 1e-4 ? 1U : 0U;
    return points;
  };
  EXPECT_GE(inside(r), 5U);
  // What the search is for.
  o.seek_resonances = false;
  const HarmonicResult blind = a.response(o);
  ASSERT_TRUE(blind.status.ok()) << blind.status.message;
  EXPECT_FALSE(blind.complete);
  EXPECT_EQ(inside(blind), 0U);
}

// Modes that the load does not move, or the observer does not see, cost nothing: load and observer in the middle of a
// symmetric chain.
TEST(HarmonicInterpolation, ModesThatDoNotAnswerAreNotFollowed) {
  constexpr int n = 21;
  Case a = chain_case(n, 1e-5);
  a.f = Eigen::VectorXcd::Unit(n, n / 2);
  HarmonicOptions o = range(0.01, 0.33, 100, 1e-3);
  o.observed = {n / 2};
  const HarmonicResult r = a.response(o);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  Index excited = 0;
  for (const HarmonicResonance& x : r.resonances) excited += x.excited ? 1 : 0;
  EXPECT_GE(r.resonances.size(), 20U);
  EXPECT_GE(excited, 10);
  EXPECT_LE(excited, 11);
}

// Without damping: poles on the axis; every point away from them is right.
TEST(HarmonicInterpolation, WithoutDamping) {
  constexpr int n = 10;
  const Case a = chain_case(n, 0);
  const HarmonicResult r = a.response(range(0.001, 0.33, 300, 1e-4));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_TRUE(r.complete);
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    double near = INFINITY;
    for (const HarmonicResonance& x : r.resonances)
      near = std::min(near, std::abs(x.frequency - r.points[i].frequency));
    if (near < 1e-5) continue;
    const Eigen::MatrixXcd exact = a.truth()(r.points[i].frequency);
    EXPECT_LE((Eigen::Map<const Eigen::MatrixXcd>(&r.responses[i * 2 * n], n, 2) - exact).norm(), 1e-3 * exact.norm())
        << r.points[i].frequency;
  }
}

// Hysteretic and unsymmetric systems: no proof for the latter, and the dense answer for both.
TEST(HarmonicInterpolation, OfHystereticAndUnsymmetricSystems) {
  constexpr int n = 10;
  Case a = chain_case(n, 0);
  a.eta = 2e-3;
  HarmonicOptions o = range(0.001, 0.33, 400, 1e-4);
  o.loss_factor = a.eta;
  const HarmonicResult hysteretic = a.response(o);
  ASSERT_TRUE(hysteretic.status.ok()) << hysteretic.status.message;
  EXPECT_TRUE(hysteretic.complete);
  EXPECT_LE(test::worst_error(hysteretic, a.truth()), 2e-4);
  Case g = chain_case(n, 1e-3);
  for (int i = 1; i < n; ++i) g.c(i, i - 1) -= 0.05, g.c(i - 1, i) += 0.05;
  const HarmonicResult unsymmetric = g.response(range(0.001, 0.33, 400, 1e-4));
  ASSERT_TRUE(unsymmetric.status.ok()) << unsymmetric.status.message;
  EXPECT_FALSE(unsymmetric.complete);
  EXPECT_NE(unsymmetric.completeness.find("not symmetric"), std::string::npos);
  EXPECT_LE(test::worst_error(unsymmetric, g.truth()), 2e-4);
}

TEST(HarmonicInterpolation, SaysWhenItsSolvesAreSpent) {
  const Case a = chain_case(40, 1e-4);
  HarmonicOptions o = range(0.001, 0.33, 100, 1e-6);
  o.max_solves = 20;
  const HarmonicResult r = a.response(o);
  EXPECT_EQ(r.status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(r.status.message.find("20 frequencies were solved"), std::string::npos) << r.status.message;
  EXPECT_FALSE(r.complete);
  EXPECT_EQ(r.factorizations, 20);
  EXPECT_GE(r.points.size(), 100U);  // with their estimates
}

/// A free chain with structural damping: singular at frequency 0.
Case free_chain(int n) {
  Case a{test::chain(n), {}, Eigen::MatrixXd::Identity(n, n), Eigen::MatrixXcd::Zero(n, 1)};
  a.k(0, 0) = a.k(n - 1, n - 1) = 1;
  a.c = Eigen::MatrixXd::Zero(n, n);
  a.f(0, 0) = 1;
  a.eta = 0.02;
  return a;
}

// Truth: the dense answer at all other frequencies; the singular one alone is said to be so.
TEST(HarmonicEdges, TheLowestFrequencyIsSingular) {
  const Case a = free_chain(12);
  for (const double to : {5.0, 0.4, 0.05, 1e-3})
    for (const double tolerance : {1e-2, 1e-4})
      for (const Index points : {2, 3, 101}) {
        HarmonicOptions o = range(0, to, points, tolerance);
        o.loss_factor = a.eta;
        const HarmonicResult r = a.response(o);
        SCOPED_TRACE(fmt::format("to {}, tolerance {}, {} points", to, tolerance, points));
        EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;
        ASSERT_GE(r.points.size(), static_cast<std::size_t>(points));
        EXPECT_EQ(r.points[0].frequency, 0);
        EXPECT_FALSE(r.points[0].status.ok());
        for (std::size_t i = 1; i < r.points.size(); ++i) EXPECT_TRUE(r.points[i].status.ok()) << r.points[i].frequency;
        EXPECT_LE(test::worst_error(r, a.truth()), 10 * tolerance);
      }
  // Points next to it are solved, each.
  HarmonicOptions o = range(0, 1, 20001, 1e-4);
  o.loss_factor = a.eta;
  o.observed = {0};
  const HarmonicResult dense = a.response(o);
  ASSERT_GE(dense.points.size(), 20001U);
  EXPECT_TRUE(dense.points[1].solved);
  EXPECT_LE(test::worst_error(dense, a.truth()), 1e-3);
  // Where w^2 M is below rounding of K, all frequencies are singular.
  o = range(0, 1e-9, 3, 1e-4);
  o.loss_factor = a.eta;
  EXPECT_EQ(static_cast<int>(a.response(o).status.code), static_cast<int>(StatusCode::singular));
}

// A mass of rank 3, with damping beta K: four motions are free. The function with the last checks in it has a pole of
// its own beside the samples at 1e-4 of the range; it was not looked at. Truth: the dense answer, and the estimates.
TEST(HarmonicEdges, TheLastFunctionIsLookedAt) {
  constexpr double kTolerance = 1e-7;
  Case a{Eigen::MatrixXd(7, 7), {}, Eigen::MatrixXd::Identity(7, 7), Eigen::MatrixXcd(7, 1)};
  a.k << 6, 4, -2, 0, 4, -1, 0,  //
      4, 6, -4, -4, 4, -3, -2,   //
      -2, -4, 6, 0, 0, 7, 0,     //
      0, -4, 0, 8, -4, -2, 4,    //
      4, 4, 0, -4, 5, 2, -2,     //
      -1, -3, 7, -2, 2, 9, -1,   //
      0, -2, 0, 4, -2, -1, 2;
  a.c = 0.01 * a.k;
  a.m(3, 3) = 0.5;
  a.f << 2, -1, 2, 0, 1, 0, -2;
  HarmonicOptions o = range(0, 5, 3, kTolerance);
  o.observed = {4};
  o.seek_resonances = false;
  const HarmonicResult r = a.response(o);
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;  // at 0
  std::size_t between = 0;
  std::vector<double> sizes;  // of what was solved
  for (std::size_t i = 0; i < r.points.size(); ++i)
    if (r.points[i].solved && r.points[i].status.ok()) sizes.push_back(std::abs(r.response(i, 0, 0)));
  ASSERT_FALSE(sizes.empty());
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
  const double floor = 0.01 * sizes[sizes.size() / 2];
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    if (r.points[i].solved) continue;
    ++between;
    const double f = r.points[i].frequency;
    const Complex exact = a.truth()(f)(4, 0);
    EXPECT_LE(r.points[i].error_estimate, kTolerance) << f;
    EXPECT_LE(std::abs(r.response(i, 0, 0) - exact), 10 * kTolerance * std::max(std::abs(exact), floor)) << f;
  }
  EXPECT_GE(between, 10U);
}

// Two chains, far above whose resonances most of the first samples lie: there the unknowns far from the loads are tiny.
// In units of these the sums of a fit are those unknowns alone, and the others were off by more than they are. Truth:
// the dense answer.
TEST(HarmonicInterpolation, TinyResponsesDoNotHideTheOthers) {
  constexpr double kTolerance = 0.05;
  Case a = chain_case(7, 0);
  a.k(0, 0) = a.k(6, 6) = 1;
  a.k(2, 3) = a.k(3, 2) = 0;
  a.c = 0.01 * a.k;
  a.m.diagonal() << 0.5, 1, 0.5, 0.5, 0.5, 2, 0.5;
  a.f = Eigen::MatrixXcd(7, 1);
  a.f << -1, -2, -2, 2, -1, 0, 0;
  const HarmonicResult r = a.response(range(0, 5, 2, kTolerance));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LE(test::worst_error(r, a.truth()), 2 * kTolerance);
}

// Oscillators without damping beside each other, each in resonance at one of the first samples or of the frequencies
// asked for: at either end, at both, in the middle, at all. Truth: their closed forms.
TEST(HarmonicEdges, ResonancesAtSamples) {
  constexpr double kFrom = 1, kTo = 9;
  const std::vector<std::vector<double>> cases = {{1},      {9}, {1, 9}, {5}, {1, 5, 9}, {1, 2, 3, 4, 5, 6, 7, 8, 9},
                                                  {1, 1, 9}};
  for (const std::vector<double>& at : cases) {
    const auto n = static_cast<Eigen::Index>(at.size());
    Case a{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Identity(n, n),
           Eigen::MatrixXcd::Ones(n, 1)};
    for (Eigen::Index i = 0; i < n; ++i) a.k(i, i) = std::pow(kTwoPi * at[static_cast<std::size_t>(i)], 2);
    for (const bool modes : {true, false}) {
      HarmonicOptions o = range(kFrom, kTo, 33, 1e-3);
      o.seek_resonances = modes;
      o.shapes_at = {1, 5};
      const HarmonicResult r = a.response(o);
      EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;
      EXPECT_GE(r.points.size(), 33U);
      for (std::size_t i = 0; i < r.points.size(); ++i) {
        const double f = r.points[i].frequency;
        const bool resonant = std::find(at.begin(), at.end(), f) != at.end();
        EXPECT_EQ(r.points[i].status.ok(), !resonant) << f;
      }
    }
  }
}

// Two equal rows: singular at each frequency, by no pattern.
TEST(HarmonicEdges, SingularEverywhere) {
  Case a{Eigen::MatrixXd::Ones(2, 2), Eigen::MatrixXd::Zero(2, 2), Eigen::MatrixXd::Ones(2, 2),
         Eigen::MatrixXcd::Ones(2, 1)};
  for (const double tolerance : {0.0, 1e-3})
    for (const bool modes : {true, false}) {
      HarmonicOptions o = range(0.5, 2, 11, tolerance);
      o.seek_resonances = modes;
      o.solver.kind = Kind::lu;
      const HarmonicResult r = a.response(o);
      EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;
      EXPECT_FALSE(r.complete);
    }
}

// Ranges as short, as low and as high as numbers go, and shapes beside them: an answer or a message, and no more solves
// than allowed.
TEST(HarmonicEdges, RangesAtTheEdgesOfNumbers) {
  const Case a = chain_case(5, 1e-3);
  constexpr double kTiny = 1e-300, kHuge = 1e150;
  const std::vector<std::pair<double, double>> ranges = {{0, kTiny},
                                                         {kTiny, 2 * kTiny},
                                                         {0.1, std::nextafter(0.1, 1.0)},
                                                         {0.1, 0.1 * (1 + 1e-12)},
                                                         {0, kHuge},
                                                         {kHuge, 2 * kHuge},
                                                         {0, 1e308},
                                                         {0, 1e6}};
  for (const auto& [from, to] : ranges)
    for (const double tolerance : {0.0, 1e-3}) {
      HarmonicOptions o = range(from, to, 2, tolerance);
      o.max_solves = 50;
      o.shapes_at = {from, 0.2};
      const HarmonicResult r = a.response(o);
      EXPECT_LE(r.factorizations, 53) << from << " to " << to << ": " << r.status.message;
      if (r.status.ok()) {
        EXPECT_LE(test::worst_error(r, a.truth()), 0.1) << from << " to " << to;
      } else {
        EXPECT_FALSE(r.status.message.empty());
      }
    }
}

// As many points as are allowed, of many unknowns: more than the machine holds.
TEST(HarmonicEdges, MorePointsThanMemory) {
  const Case a = chain_case(3, 1e-3);
  HarmonicOptions o = range(0.1, 1, 10'000'000, 1e-3);
  o.solver.host_memory_bytes = Offset{1} << 24;
  const HarmonicResult r = a.response(o);
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::out_of_memory)) << r.status.message;
}

}  // namespace
}  // namespace espalier
