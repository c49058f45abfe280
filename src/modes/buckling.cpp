#include "modes/buckling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/stopwatch.hpp"

namespace espalier::modes {

namespace {

constexpr int kSearches = 4;
constexpr Index kSolved = 32;  // columns at a time in the end

// Rows of constraints, [A G^T; G 0]: nothing on the diagonal of either matrix.
Index constraint_rows(const SparseMatrix& k, const SparseMatrix& kg) {
  const std::vector<double> d = diagonal_of(k), dg = diagonal_of(kg);
  Index rows = 0;
  for (std::size_t i = 0; i < d.size(); ++i) rows += d[i] == 0 && dg[i] == 0 ? 1 : 0;
  return rows;
}

// A alone: for shapes that satisfy G u = 0 its products are those of K, without the rounding of large multipliers.
SparseMatrix without_constraints(const SparseMatrix& k, const SparseMatrix& kg) {
  const std::vector<double> d = diagonal_of(k), dg = diagonal_of(kg);
  SparseMatrix a = k;
  const auto constraint = [&](Index i) {
    return d[static_cast<std::size_t>(i)] == 0 && dg[static_cast<std::size_t>(i)] == 0;
  };
  for (Index j = 0; j < a.cols; ++j)
    for (auto p = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
         p < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]); ++p)
      if (constraint(j) || constraint(a.row_ind[p])) a.values[p] = 0;
  return a;
}

}  // namespace

BucklingSearch::BucklingSearch(SparseMatrix k, SparseMatrix kg, const ModesOptions& options, Resources& shop,
                               ModesResult& result)
    : options_(options),
      shop_(shop),
      result_(result),
      pencil_(std::move(k), std::move(kg), options, shop.pool),
      stiffness_(without_constraints(pencil_.k(), pencil_.m()), shop.pool),
      geometric_(pencil_.m(), shop.pool),
      multipliers_(constraint_rows(pencil_.k(), pencil_.m())),
      wanted_(options.count) {
  const auto counted = [this](const Product& product) {
    return [this, &product](const double* x, double* y, Index columns) {
      const base::Stopwatch watch(result_.seconds.products);
      product.apply(shop_.pool, x, y, columns);
    };
  };
  op_.n = pencil_.n();
  op_.a = counted(geometric_);
  op_.b = counted(stiffness_);
  op_.solve = [this](const double* x, double* y, Index columns) { pencil_.solve(x, y, columns); };
  op_.inner = "K";
  op_.weights = [this, diagonal = diagonal_of(pencil_.k())](const double* w, Index columns) {
    return weighted_squares(shop_.pool, pencil_.n(), diagonal.data(), w, columns);
  };
  result_.n = pencil_.n();
}

void BucklingSearch::run() {
  stage_.expect(wanted_);
  if (wanted_ == 0)
    throw Error(StatusCode::invalid_input, "nothing is asked for: give the number of load factors (count)");
  if (wanted_ > pencil_.n() - 2 * multipliers_)
    throw Error(StatusCode::invalid_input, fmt::format("{} load factors are asked for, and there are {} at most",
                                                       wanted_, std::max<Index>(0, pencil_.n() - 2 * multipliers_)));
  for (int k = 0; k < kSearches && !result_.complete; ++k) {
    factorize_stiffness();
    explore();
    if (harvest_.size() < wanted_) {
      if (!exhausted_) continue;
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} load factors are asked for; Kg has {} positive eigenvalues where constraints hold",
                              wanted_, harvest_.size()));
    }
    if (!options_.prove) {
      result_.completeness = "not proven: no count was asked for";
      return;
    }
    prove();
  }
  if (!result_.complete)
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("{} of {} load factors were found, {}; allow a longer basis (basis_size), or ask for fewer",
                            std::min(wanted_, harvest_.size()), wanted_, result_.completeness));
}

// K itself: positive definite where its constraints hold, that is, with as many negative eigenvalues as constraints.
void BucklingSearch::factorize_stiffness() {
  const Shifted f = pencil_.factorize(0);
  if (!f.status.ok())
    throw Error(
        StatusCode::singular,
        "K is singular: hold free bodies, and leave out constraints that depend on others (" + f.status.message + ")",
        f.status.row);
  exact_ = exact_ && f.exact;
  if (f.negative != multipliers_)
    throw Error(StatusCode::invalid_input,
                fmt::format("K is not positive definite: it has {} negative eigenvalues, and {} rows of constraints",
                            f.negative, multipliers_));
}

void BucklingSearch::explore() {
  const Index n = pencil_.n(), known = harvest_.size();
  LanczosOptions o;
  o.wanted = {0, std::max<Index>(1, wanted_ - known)};
  o.dimension = n - 2 * multipliers_ - known;
  o.block = std::min(options_.block_size > 0 ? options_.block_size : Index{8}, std::max<Index>(o.dimension, 1));
  o.tolerance = options_.tolerance;
  o.converged = [this, known](Index good) { stage_.reach(known + good); };
  o.seed = options_.seed + 7919 * static_cast<std::uint64_t>(clock_.columns);
  if (o.dimension <= 0) return;
  const Index usual = options_.basis_size > 0 ? options_.basis_size : 3 * o.wanted.positive + 12 * o.block;
  const Index least = std::min<Index>(o.wanted.positive + 3 * o.block, o.dimension + o.block) + known;
  const Index most = std::max(least, std::min<Index>(usual, o.dimension + o.block) + known);
  Tall basis = shop_.basis(n, most, least, pencil_.factor_peak_bytes);
  Tall image(n, o.block, &shop_.budget);
  for (Index i = 0; i < known; ++i) std::copy_n(harvest_[i].vector, n, basis.col(i));
  const HostBlocks blocks(shop_.pool, n);
  Lanczos lanczos(op_, {blocks, basis.col(0), basis.columns(), image.col(0), o.block}, known, shop_.pool, clock_);
  const LanczosResult found = lanczos.run(o);
  result_.restarts += found.restarts;
  exhausted_ = found.exhausted || (found.next_positive == 0 && found.found.positive < o.wanted.positive);
  next_ = found.next_positive > 0 ? 1 / found.next_positive : 0;
  std::vector<Index> taken;
  std::vector<double> eigenvalues, bounds;
  for (Index i = found.found.negative; i < found.found.negative + found.found.positive; ++i) {
    const double theta = found.theta[static_cast<std::size_t>(i)];
    taken.push_back(i);
    eigenvalues.push_back(1 / theta);
    bounds.push_back(found.residual[static_cast<std::size_t>(i)] / (theta * theta));
  }
  if (taken.empty()) return;
  Tall batch(n, static_cast<Index>(taken.size()), &shop_.budget);
  combine(shop_.pool, n, basis.col(known), found.combination(Eigen::all, taken), batch.col(0));
  basis = Tall();
  purify(batch);
  harvest_.add(std::move(batch), eigenvalues, bounds);
  result_.peak_bytes = std::max(result_.peak_bytes, pencil_.factor_peak_bytes + shop_.budget.peak());
}

// As in the search for vibrations: multipliers become those that belong to the shapes.
void BucklingSearch::purify(Tall& batch) {
  Tall image(pencil_.n(), std::min(batch.columns(), kSolved), &shop_.budget);
  for (Index c = 0; c < batch.columns(); c += kSolved) {
    const Index width = std::min(kSolved, batch.columns() - c);
    op_.a(batch.col(c), image.col(0), width);
    const base::Stopwatch watch(clock_.solves);
    pencil_.solve(image.col(0), batch.col(c), width);
    clock_.columns += width;
  }
  orthonormalize(shop_.pool, op_.b, batch, image);
}

double BucklingSearch::gap_after_wanted() const {
  double best = 0, widest = -1;
  for (Index i = wanted_ - 1; i < harvest_.size(); ++i) {
    const double here = harvest_[i].eigenvalue;
    const double next = i + 1 < harvest_.size() ? harvest_[i + 1].eigenvalue : next_ > here ? next_ : 2 * here;
    const double gap = (next - here) / here;
    if (gap > widest) best = here + 0.3 * (next - here), widest = gap;
    if (gap > 1e-4) break;
  }
  return best;
}

// K - e Kg has as many more negative eigenvalues than K as there are load factors between 0 and e.
void BucklingSearch::prove() {
  const double end = gap_after_wanted();
  const Shifted f = pencil_.factorize(end);
  if (!f.status.ok() || f.negative < multipliers_) {
    result_.completeness = fmt::format("not proven: K - e Kg could not be factorized at e = {:.6g}", end);
    return;
  }
  const Index between = f.negative - multipliers_;
  result_.counts.push_back({end, between});
  exact_ = exact_ && f.exact;
  result_.complete = between == harvest_.below(end) && exact_;
  result_.completeness = fmt::format(
      "{}K - e Kg has {} negative eigenvalues more than K at e = {:.17g}, and {} load factors below e were "
      "found",
      result_.complete ? "" : "not proven: ", between, end, harvest_.below(end));
}

void BucklingSearch::deliver() {
  note_costs(pencil_, clock_, result_);
  harvest_.deliver(wanted_, pencil_.n(), shop_.pool, result_);
  if (result_.count() > 0)
    examine(pencil_.k(), pencil_.m(), Product(pencil_.k(), shop_.pool), geometric_, true, shop_, result_);
}

}  // namespace espalier::modes
