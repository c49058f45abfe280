/// \file
/// The Hessians of large jets (16 variables): inlined, the hundred products of a beam's strains are more code than a
/// compiler or a cache can bear.
#pragma once

namespace espalier::dynamics {

inline constexpr int kLargeJet = 16;

/// h += s b, 16 x 16
void add_hessian(double s, const double* b, double* h);
/// h = u a'' + v b'' + a' b'^T + b' a'^T for numbers a (value v) and b (value u): the Hessian of a b
void product_hessian(double u, const double* a2, double v, const double* b2, const double* a1, const double* b1,
                     double* h);
/// h = df a'' + ddf a' a'^T
void chain_hessian(double df, const double* a2, double ddf, const double* a1, double* h);

}  // namespace espalier::dynamics
