// All dashpots of a kick at once: (M + h C) v' = M v + h F for the velocities, by conjugate gradients.
//
// The clamp is part of what is solved, f = max(c u', -k d): contacts that would pull are taken out and the rest is
// solved again, until none changes sides (Newton's method on a convex energy).
//
// Order 1: the dashpots are stepped by the implicit Euler rule. Two-stage rules of order 2 push a second time in their second
// stage; under a clamp that makes impacts bounce which the law stops dead.
// Stable while h2 times the springs' stiffness form is at most 4, whatever the dashpots; these only take energy.
#include "core/check.hpp"
#include "core/dashpot_split.hpp"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/LU>

#include <algorithm>
#include <numeric>

namespace grainclock::core {
class DampedMass;
}
template <>
struct Eigen::internal::traits<grainclock::core::DampedMass> : Eigen::internal::traits<Eigen::SparseMatrix<double>> {};

namespace grainclock::core {

/// M + h C for velocities ball by ball, never made as a matrix.
class DampedMass : public Eigen::EigenBase<DampedMass> {
 public:
  using Scalar = double;
  using RealScalar = double;
  using StorageIndex = int;
  enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic, IsRowMajor = false };
  static constexpr Eigen::Index kFixed = -1;

  /// A dashpot of h c [kg] along `normal`.
  struct Link {
    Eigen::Index i, j;  // first components of its balls; j may be kFixed
    Vec3 normal;
    double mass;
  };

  Eigen::Index rows() const { return mass.size(); }
  Eigen::Index cols() const { return mass.size(); }
  template <class Right>
  Eigen::Product<DampedMass, Right, Eigen::AliasFreeProduct> operator*(const Eigen::MatrixBase<Right>& v) const {
    return {*this, v.derived()};
  }
  void add_product(const Eigen::VectorXd& v, Eigen::VectorXd& to) const {
    to += mass.cwiseProduct(v);
    for (const Link& link : links) {
      Vec3 relative = v.segment<3>(link.i);
      if (link.j != kFixed) relative -= v.segment<3>(link.j);
      const Vec3 pull = link.mass * link.normal.dot(relative) * link.normal;
      to.segment<3>(link.i) += pull;
      if (link.j != kFixed) to.segment<3>(link.j) -= pull;
    }
  }

  Eigen::VectorXd mass;  // kg, three times per ball
  std::vector<Link> links;
};

/// The inverse of its blocks of one ball each, as a preconditioner.
class BallBlocks {
 public:
  using StorageIndex = int;
  enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic };

  BallBlocks& analyzePattern(const DampedMass&) { return *this; }
  BallBlocks& factorize(const DampedMass& matrix) {
    inverse_.assign(static_cast<std::size_t>(matrix.rows() / 3), Eigen::Matrix3d::Zero());
    for (std::size_t ball = 0; ball < inverse_.size(); ++ball)
      inverse_[ball].diagonal().setConstant(matrix.mass[static_cast<Eigen::Index>(3 * ball)]);
    for (const DampedMass::Link& link : matrix.links) {
      const Eigen::Matrix3d block = link.mass * link.normal * link.normal.transpose();
      inverse_[static_cast<std::size_t>(link.i / 3)] += block;
      if (link.j != DampedMass::kFixed) inverse_[static_cast<std::size_t>(link.j / 3)] += block;
    }
    for (Eigen::Matrix3d& block : inverse_) block = block.inverse().eval();
    return *this;
  }
  BallBlocks& compute(const DampedMass& matrix) { return factorize(matrix); }
  Eigen::VectorXd solve(const Eigen::VectorXd& right) const {
    Eigen::VectorXd out(right.size());
    for (std::size_t ball = 0; ball < inverse_.size(); ++ball) {
      const auto at = static_cast<Eigen::Index>(3 * ball);
      out.segment<3>(at) = inverse_[ball] * right.segment<3>(at);
    }
    return out;
  }
  Eigen::ComputationInfo info() const { return Eigen::Success; }

 private:
  std::vector<Eigen::Matrix3d> inverse_;
};

}  // namespace grainclock::core

namespace Eigen::internal {

template <class Right>
struct generic_product_impl<grainclock::core::DampedMass, Right, SparseShape, DenseShape, GemvProduct>
    : generic_product_impl_base<grainclock::core::DampedMass, Right,
                                generic_product_impl<grainclock::core::DampedMass, Right>> {
  using Scalar = double;
  template <class Target>
  static void scaleAndAddTo(Target& to, const grainclock::core::DampedMass& matrix, const Right& v, const double& /*one*/) {
    matrix.add_product(v, to);
  }
};

}  // namespace Eigen::internal

namespace grainclock::core {

namespace {

/// Residual of a solve over the momenta. What it leaves is an error of velocities, by as much; momentum is exact all the same,
/// for forces come from the law. Rounding alone makes 1e-16 of the matrix' condition, 1e-12 at h c / m = 1e4.
constexpr double kTolerance = 1e-12;
constexpr int kMostRounds = 100;

class SolveStepper final : public SplitStepper {
 public:
  using SplitStepper::SplitStepper;

 private:
  void find_dashpots() override {
    place_balls();
    kick_without_dashpots(velocity_);
    start_.resize(matrix_.rows());
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) start_.segment<3>(place_[row]) = velocity_[row];
    end_ = start_;
    pressed_.clear();
    for (const Touch& touch : touches_) {
      const double inertia = balls_.inverse_mass[touch.i] + (touch.both ? balls_.inverse_mass[touch.j] : 0.0);
      pressed_.push_back(touch.c * rate(touch, end_) / (1.0 + step_ * touch.c * inertia) > touch.least ? 1 : 0);
    }
    for (int round = 0; !solve_pressed(); ++round) {
      if (round == kMostRounds) fail("the contacts that pull do not settle");
    }
  }

  /// Balls in order of ids, so that sums do not depend on the sort in space.
  void place_balls() {
    const std::size_t n = balls_.content_count();
    order_.resize(n);
    std::iota(order_.begin(), order_.end(), 0U);
    std::sort(order_.begin(), order_.end(), [this](std::uint32_t a, std::uint32_t b) { return balls_.id[a] < balls_.id[b]; });
    place_.resize(n);
    matrix_.mass.resize(static_cast<Eigen::Index>(3 * n));
    for (std::size_t k = 0; k < n; ++k) {
      place_[order_[k]] = static_cast<Eigen::Index>(3 * k);
      matrix_.mass.segment<3>(place_[order_[k]]).setConstant(mass(order_[k]));
    }
  }

  /// Adds an impulse [N s] along the touch's normal to velocities.
  void add_impulse(const Touch& touch, double impulse, Eigen::VectorXd& velocity) const {
    velocity.segment<3>(place_[touch.i]) += balls_.inverse_mass[touch.i] * impulse * touch.normal;
    if (touch.both) velocity.segment<3>(place_[touch.j]) -= balls_.inverse_mass[touch.j] * impulse * touch.normal;
  }

  double rate(const Touch& touch, const Eigen::VectorXd& velocity) const {
    Vec3 relative = velocity.segment<3>(place_[touch.i]);
    if (touch.both) relative -= velocity.segment<3>(place_[touch.j]);
    return -touch.normal.dot(relative);
  }

  /// Finds the velocities if the pressed contacts have their dashpots and the others pull with what their springs push, and from
  /// these the forces. Whether the same contacts are pressed then.
  bool solve_pressed() {
    matrix_.links.clear();
    momentum_ = start_;
    for (std::size_t t = 0; t < touches_.size(); ++t) {
      const Touch& touch = touches_[t];
      if (pressed_[t] == 0) {
        add_impulse(touch, step_ * touch.least, momentum_);
      } else {
        matrix_.links.push_back({place_[touch.i], touch.both ? place_[touch.j] : DampedMass::kFixed, touch.normal, step_ * touch.c});
      }
    }
    momentum_ = matrix_.mass.cwiseProduct(momentum_);
    gradients_.setTolerance(kTolerance);
    gradients_.compute(matrix_);
    end_ = gradients_.solveWithGuess(momentum_, end_);
    if (gradients_.info() != Eigen::Success) fail("the linear solve does not converge");

    bool settled = true;
    for (std::size_t t = 0; t < touches_.size(); ++t) {
      Touch& touch = touches_[t];
      const double wanted = touch.c * rate(touch, end_);
      const std::uint8_t pressed = wanted > touch.least ? 1 : 0;
      touch.dashpot = std::max(touch.least, wanted);
      settled = settled && pressed == pressed_[t];
      pressed_[t] = pressed;
    }
    return settled;
  }

  [[noreturn]] void fail(const char* what) const {
    throw NumericsError(fmt::format("dashpot = \"solve\": {} in the step that began at {:.6g} s (step {:.3g} s); use a smaller step",
                                    what, elapsed(), step_));
  }

  std::vector<std::uint32_t> order_;
  std::vector<Eigen::Index> place_;  // first component, per row
  std::vector<Vec3> velocity_;       // m/s, per row
  Eigen::VectorXd start_, end_;      // m/s
  Eigen::VectorXd momentum_;         // kg m/s
  std::vector<std::uint8_t> pressed_;  // per touch
  DampedMass matrix_;
  Eigen::ConjugateGradient<DampedMass, Eigen::Lower | Eigen::Upper, BallBlocks> gradients_;
};

}  // namespace

std::unique_ptr<Stepper> make_solve_stepper(const State& state, const StepperSetup& setup) {
  return std::make_unique<SolveStepper>(state, setup);
}

}  // namespace grainclock::core
