#include "modes/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include "base/beside.hpp"
#include "base/stopwatch.hpp"
#include "matrix/norms.hpp"

namespace espalier::modes {

namespace {

// Modes sought to the right of one shift; for more another factorization is cheaper than a longer basis.
constexpr Index kAtATime = 100;
constexpr Index kSolvedColumns = 32;  // that are multiplied and solved for at a time in the end
// Residuals |K x - l M x| above these are those of no mode: relative to what the sum is made of, and to rounding of the
// largest entries. What is far from the shift may be a mixture of modes, small beside the norm of K and yet none.
constexpr double kNoMode = 1e-6, kOfRounding = 1e2 * std::numeric_limits<double>::epsilon();

}  // namespace

Search::Search(SparseMatrix k, SparseMatrix m, const ModesOptions& options, Resources& shop, ModesResult& result)
    : options_(options),
      shop_(shop),
      result_(result),
      pencil_(std::move(k), std::move(m), options, shop.pool),
      stiffness_(pencil_.k(), shop.pool),
      mass_(pencil_.m(), shop.pool),
      mass_diagonal_(diagonal_of(pencil_.m())),
      k_norm_(matrix::norm_inf(pencil_.k(), &shop.pool)),
      m_norm_(matrix::norm_inf(pencil_.m(), &shop.pool)) {
  op_.n = pencil_.n();
  op_.inner = "M";
  op_.weights = [this](const double* w, Index columns) {
    return weighted_squares(shop_.pool, pencil_.n(), mass_diagonal_.data(), w, columns);
  };
  op_.b = [this](const double* x, double* y, Index columns) {
    const base::Stopwatch watch(result_.seconds.products);
    mass_.apply(shop_.pool, x, y, columns);
  };
  op_.solve = [this](const double* x, double* y, Index columns) {
    pencil_.solve(x, y, columns);
    clear_massless(y, columns);
  };
  result_.n = pencil_.n();
}

// Rows without mass take no part in any product of the search. Where a direction that is rounding is made one of length
// 1, they would grow each time, and without end.
void Search::clear_massless(double* x, Index columns) const {
  if (report_.massless == 0) return;
  const std::size_t n = mass_diagonal_.size();
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c)
    for (std::size_t i = 0; i < n; ++i)
      if (mass_diagonal_[i] == 0) x[c * n + i] = 0;
}

void Search::run() {
  measure();
  look_at_mass_and_prepare();
  stage_.expect(options_.count);
  result_.finite = report_.finite;
  result_.massless = report_.massless;
  if (options_.count > report_.finite) refuse_count();
  block_ = std::min(options_.block_size > 0 ? options_.block_size : Index{8}, report_.finite);
  constexpr int kBeginnings = 4;
  for (int beginning = 1;; ++beginning) {
    seek();
    if (beginning == kBeginnings || !contradicted()) break;
    start_anew();
  }
  say_complete();
}

void Search::seek() {
  wanted_ = options_.count > 0 ? options_.count : report_.finite;
  if (!std::isinf(options_.below)) count_below_bound();
  stage_.expect(wanted_);
  if (wanted_ == 0 || finished()) return;
  choose_first();
  do {
    explore();
  } while (!finished() && choose_next());
}

// More were found below a number than there are: either the count is wrong, next to many equal eigenvalues, or what was
// found is. The next search begins farther from zero, where K - s M is better conditioned.
void Search::start_anew() {
  constexpr double kFarther = 1e3;
  shop_.log("modes: a count contradicts what was found; the search begins anew");
  harvest_ = {};
  counts_.clear();
  exact_ = true;
  extra_ = before_ = 0;
  unit_ *= kFarther;
}

// M beside the analysis of K - s M, which does not need to know. The caller is asked for interruption, and hears, on
// this thread alone.
void Search::look_at_mass_and_prepare() {
  const bool beside = shop_.pool.size() > 1;
  Options of_mass = options_.solver;
  if (beside) of_mass.interrupted = nullptr, of_mass.log = nullptr;
  auto report = base::start_beside(
      [&] {
        const base::Stopwatch watch(result_.seconds.mass);
        return look_at_mass(pencil_.k(), pencil_.m(), options_.check_mass, of_mass);
      },
      beside);
  std::exception_ptr failure;
  try {
    pencil_.prepare(first_shift());
  } catch (...) {
    failure = std::current_exception();
  }
  report_ = report.get();  // what is wrong with M is said first
  if (failure) std::rethrow_exception(failure);
}

bool Search::finished() const {
  if (harvest_.size() >= report_.finite) return true;
  if (!options_.prove && harvest_.size() >= wanted_ && attempts_ > 0) return true;
  const auto end = proven();
  return end && proves_wanted(*end);
}

Index Search::known_beyond(double from) const { return harvest_.size() - harvest_.below(from); }

// On the GPU that has the factor, if there is one and it has room.
std::optional<Workspace> Search::device_workspace(Index most, Index least) {
  if (!device_asked_) on_device_ = DeviceSearch::make(pencil_, mass_, mass_diagonal_, shop_, result_);
  device_asked_ = true;
  return on_device_ ? on_device_->workspace(most, least, block_) : std::nullopt;
}

// The modes next to the shift that are not known yet: all below it, and to the right as many as are wanted.
void Search::explore() {
  const auto sure = proven();
  const double from = sure ? std::min(sure->at, shift_) : -std::numeric_limits<double>::infinity();
  const Index left = std::max<Index>(0, below_shift_ - harvest_.below(shift_));
  const Index sought = std::min(wanted_ + extra_, report_.finite);
  const Index right = std::clamp<Index>(sought - below_shift_, 0, kAtATime + extra_) - known_beyond(shift_);
  ++attempts_;
  news_ = false;
  if (left == 0 && right <= 0) return;
  LanczosOptions o;
  o.wanted = {left, std::max<Index>(right, 0)};
  o.block = block_;
  o.tolerance = options_.tolerance;
  o.seed = options_.seed + 7919 * draws_++;
  const Index known = known_beyond(from), want = o.wanted.negative + o.wanted.positive;
  o.converged = [this, before = harvest_.size()](Index good) { stage_.reach(before + good); };
  o.dimension = report_.rank - known;
  const Index usual = options_.basis_size > 0 ? options_.basis_size : 2 * want + 12 * block_;
  const Index most = std::min<Index>(std::max(usual, want + 3 * block_), o.dimension + block_) + known;
  const Index least = std::min<Index>(want + 3 * block_, o.dimension + block_) + known;
  const Sought sought_now{o, from, known, most, least};
  const Index had = harvest_.size();
  LanczosResult found;
  try {
    found = search(sought_now);
  } catch (const Error& e) {
    if (!on_device_ || e.status().code != StatusCode::out_of_memory) throw;
    shop_.log(fmt::format("modes: the basis goes to the host: {}", e.what()));
    on_device_.reset();
    found = search(sought_now);
  }
  news_ = harvest_.size() > had;
  stage_.reach(harvest_.size());
  shop_.log(fmt::format("modes: shift {:.6g}: {} of {} below and {} of {} above it found, {} right-hand sides so far",
                        shift_, found.found.negative, left, found.found.positive, right, clock_.columns));
}

// With the vectors on the GPU where they have room, else on the host. What was found goes into the harvest.
LanczosResult Search::search(const Sought& sought) {
  const auto& [o, from, known, most, least] = sought;
  const Index n = pencil_.n();
  std::optional<Workspace> space = device_workspace(most, least);
  const bool here = !space;
  const HostBlocks blocks(shop_.pool, n);
  Tall basis, image;  // of the host
  if (here) {
    basis = shop_.basis(n, most, least, pencil_.factor_peak_bytes);
    image = Tall(n, block_, &shop_.budget);
    space.emplace(Workspace{blocks, basis.col(0), basis.columns(), image.col(0), block_});
  }
  // Modes found above the last shift are kept out of the search: they would be found again.
  for (Index i = 0, first = harvest_.below(from); i < known; ++i) {
    const double* vector = harvest_[first + i].vector;
    double* const to = space->basis + static_cast<std::int64_t>(n) * i;
    if (here) {
      std::copy_n(vector, n, to);
      clear_massless(to, 1);
    } else {
      on_device_->send(to, vector, 1);
    }
  }
  Lanczos lanczos(here ? op_ : on_device_->op(), *space, known, shop_.pool, clock_);
  LanczosResult found = lanczos.run(o);
  result_.restarts += found.restarts;
  result_.peak_bytes = std::max(result_.peak_bytes, pencil_.factor_peak_bytes + shop_.budget.peak());
  double* const after_known = space->basis + static_cast<std::int64_t>(n) * known;
  collect(found, [&](const Dense& s, double* to) {
    if (!here) return on_device_->fetch(after_known, s, to);
    combine(shop_.pool, n, after_known, s, to);
    basis = Tall();  // its memory serves the products
  });
  return found;
}

// Those that were found, into the harvest. @param make  columns of the basis times a small matrix
void Search::collect(const LanczosResult& found, const std::function<void(const Dense&, double*)>& make) {
  right_edge_ = found.next_positive > 0 ? shift_ + 1 / found.next_positive : std::numeric_limits<double>::quiet_NaN();
  // More than lie below or above the shift cannot be there: the last ones are rounding.
  const Index left = std::min(found.found.negative, std::max<Index>(0, below_shift_ - harvest_.below(shift_)));
  const Index right = std::max<Index>(0, report_.finite - below_shift_ - known_beyond(shift_));
  std::vector<Index> taken;
  for (Index i = 0; i < static_cast<Index>(found.theta.size()); ++i)
    if (i < left || (i >= found.found.negative && i < found.found.negative + right)) taken.push_back(i);
  if (taken.empty()) return;
  // Those next to the shift first: the others are made orthogonal to them, since rounding leaves most in their
  // direction.
  std::stable_sort(taken.begin(), taken.end(), [&](Index a, Index b) {
    return std::abs(found.theta[static_cast<std::size_t>(a)]) > std::abs(found.theta[static_cast<std::size_t>(b)]);
  });
  std::vector<double> eigenvalues, bounds;
  for (const Index i : taken) {
    const double theta = found.theta[static_cast<std::size_t>(i)];
    eigenvalues.push_back(shift_ + 1 / theta);
    bounds.push_back(found.residual[static_cast<std::size_t>(i)] / (theta * theta));
  }
  double largest = 0;  // of OP: rounding of all is relative to it, also where it is known, or not taken
  for (const double theta : found.theta) largest = std::max(largest, std::abs(theta));
  for (Index i = 0; i < harvest_.size(); ++i)
    largest = std::max(largest, 1 / std::max(std::abs(harvest_[i].eigenvalue - shift_), rounding_at(shift_)));
  Tall batch(pencil_.n(), static_cast<Index>(taken.size()), &shop_.budget);
  make(found.combination(Eigen::all, taken), batch.col(0));
  const std::vector<char> good = purify(batch, std::numeric_limits<double>::epsilon() * largest, eigenvalues);
  take_modes(std::move(batch), std::move(eigenvalues), std::move(bounds), good);
}

// Into the harvest, without those that are none.
void Search::take_modes(Tall batch, std::vector<double> eigenvalues, std::vector<double> bounds,
                        const std::vector<char>& good) {
  Index kept = 0;
  for (Index c = 0; c < batch.columns(); ++c) {
    const auto from = static_cast<std::size_t>(c), to = static_cast<std::size_t>(kept);
    if (good[from] == 0) continue;
    eigenvalues[to] = eigenvalues[from];
    bounds[to] = bounds[from];
    if (kept < c) std::copy_n(batch.col(c), batch.rows(), batch.col(kept));
    ++kept;
  }
  if (kept == 0) return;
  eigenvalues.resize(static_cast<std::size_t>(kept));
  bounds.resize(static_cast<std::size_t>(kept));
  batch.keep(kept);
  harvest_.add(std::move(batch), eigenvalues, bounds);
}

// One application of OP takes out what belongs to infinite eigenvalues (B. Nour-Omid, B. Parlett, T. Ericsson, P.
// Jensen, "How to implement the spectral transformation", Math. Comp. 48, 1987). Then x^T K x is a better eigenvalue
// than that of OP, where its rounding is less.
// @param rounding  of the eigenvalues of OP
// @return of each whether it is a mode, by its residual
std::vector<char> Search::purify(Tall& batch, double rounding, std::vector<double>& eigenvalues) {
  const Index n = pencil_.n(), count = batch.columns();
  Tall image(n, std::min(count, kSolvedColumns), &shop_.budget);
  for (Index c = 0; c < count; c += kSolvedColumns) {
    const Index width = std::min(kSolvedColumns, count - c);
    op_.b(batch.col(c), image.col(0), width);
    const base::Stopwatch watch(clock_.solves);
    pencil_.solve(image.col(0), batch.col(c), width);
    clock_.columns += width;
  }
  // OP has made the part in the direction of known modes next to the shift much larger: rounding leaves some of it.
  for (int pass = 0; pass < 2; ++pass) {
    harvest_.project_out(shop_.pool, op_.b, batch, image);
    orthonormalize(shop_.pool, op_.b, batch, image);
  }
  std::vector<char> good(static_cast<std::size_t>(count), 0);
  Tall mass_image(n, image.columns(), &shop_.budget);
  const std::vector<double> k_diagonal = diagonal_of(pencil_.k());
  const Eigen::Map<const Eigen::VectorXd> diagonal(k_diagonal.data(), n);
  for (Index c = 0; c < count; c += kSolvedColumns) {
    const Index width = std::min(kSolvedColumns, count - c);
    stiffness_.apply(shop_.pool, batch.col(c), image.col(0), width);
    op_.b(batch.col(c), mass_image.col(0), width);
    for (Index j = 0; j < width; ++j) {
      const Eigen::Map<const Eigen::VectorXd> x(batch.col(c + j), n), kx(image.col(j), n), mx(mass_image.col(j), n);
      const auto at = static_cast<std::size_t>(c + j);
      double& l = eigenvalues[at];
      // Errors by rounding: eps sum |K_ii| x_i^2, of the size of the largest eigenvalue; and that of 1 / theta.
      const double of_quotient = std::numeric_limits<double>::epsilon() * x.cwiseAbs2().dot(diagonal.cwiseAbs());
      if (of_quotient < rounding * (l - shift_) * (l - shift_)) l = x.dot(kx);
      const double parts = kx.norm() + std::abs(l) * mx.norm() + x.cwiseProduct(diagonal).norm();
      const double norms = (k_norm_ + std::abs(l) * m_norm_) * x.norm();
      good[at] = static_cast<char>((kx - l * mx).norm() <= kNoMode * parts + kOfRounding * norms);
    }
  }
  return good;
}

void Search::say_complete() {
  result_.counts = counts_;
  const auto end = proven();
  const bool all = harvest_.size() >= report_.finite;
  const bool enough = all || (end && proves_wanted(*end));
  const Index kept = std::min(wanted_, harvest_.size());
  std::string doubt = report_.why;
  if (!exact_) doubt = "pivots were replaced: the inertia is not exact";
  if (!enough) doubt = options_.prove ? "" : "no count was asked for";
  const double of_largest = 1e2 * std::numeric_limits<double>::epsilon() * largest_;
  if (enough && end && !all)
    for (Index i = 0; i < harvest_.size(); ++i)
      if (std::abs(harvest_[i].eigenvalue - end->at) <= std::max(rounding_at(end->at), of_largest))
        doubt = fmt::format("an eigenvalue lies at {:.6g}, where they were counted", end->at);
  result_.complete = enough && doubt.empty();
  if (result_.complete)
    result_.completeness =
        all ? fmt::format("all {} finite eigenvalues were found", report_.finite)
            : fmt::format(
                  "K - s M has {} negative eigenvalues at s = {:.17g} ({} of them of infinite "
                  "eigenvalues), and {} eigenvalues below s were found{}",
                  end->below + report_.negative_at_infinity, end->at, report_.negative_at_infinity, end->below,
                  end->below < wanted_ ? "; the others are equal to rounding, and s lies just below them" : "");
  else
    result_.completeness = "not proven: " + doubt;
  if (kept < wanted_ || (options_.prove && !enough)) {
    std::string what = fmt::format("{} of {} modes were found", kept, wanted_);
    for (const ModeCount& c : counts_)  // of those that are missing, the lowest
      if (const Index below = harvest_.below(c.at); below < c.below && !accounts_for(c)) {
        what += fmt::format(", and {} of the {} below {:g} {} missing", c.below - below, c.below, c.at,
                            c.below - below == 1 ? "is" : "are");
        break;
      }
    result_.completeness = "not proven: " + what;
    throw Error(StatusCode::accuracy_not_reached,
                what + "; allow a longer basis (basis_size), a larger tolerance, another shift, or ask for fewer");
  }
}

void Search::deliver() {
  note_costs(pencil_, clock_, result_);
  harvest_.deliver(wanted_, pencil_.n(), shop_.pool, result_);
  if (result_.count() > 0) examine(pencil_.k(), pencil_.m(), stiffness_, mass_, false, shop_, result_);
}

}  // namespace espalier::modes
