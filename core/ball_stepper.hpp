// What uniform and selective stepping share: balls, pair list, ledger, and the view from outside.
#pragma once

#include "core/events.hpp"
#include "core/neighbours.hpp"
#include "core/share_work.hpp"
#include "core/stepper.hpp"

#include <cmath>
#include <functional>
#include <utility>

namespace grainclock::core {

class BallStepper : public Stepper {
 public:
  double step() const final { return step_; }
  std::int64_t steps_done() const final { return steps_done_; }
  State state() const override;
  std::vector<Contact> contacts() const final;
  Energies energies() const final;
  double kinetic_energy() const final;
  Vec3 momentum() const final;
  std::vector<FixedForce> fixed_forces() const final;
  const Ledger& ledger() const final { return ledger_; }
  Costs costs() const final;

 protected:
  /// Loads the balls; rows hold the points of the last force evaluation if the state knows them.
  /// `weight_bits`: see force_scale(). `ahead`: seconds by which partners must be listed before they meet; if not 0,
  /// lists are also made to last longer.
  BallStepper(const State& state, const StepperSetup& setup, int weight_bits, double ahead);

  /// Rows from the evaluated points to the state's positions and velocities.
  void load_synchronised(const State& state);
  /// (Re)builds the list around the rows' present values and lets `follow_order` sort what runs beside them.
  void build_list();
  /// Removes the rows that `leaving` marks, which keep the list; likewise.
  void remove_balls(const std::vector<std::uint8_t>& leaving);
  /// To be called when rows have moved: a new list if a ball has used up its skin, which may sort rows anew.
  void keep_list_safe();
  /// Sorts the arrays that a stepper keeps beside the rows.
  virtual void follow_order(std::span<const std::uint32_t> order) = 0;

  /// Rows that have left through the outlet, marked; empty if none. Throws NumericsError for a ball that
  /// is not finite or left the domain elsewhere (names it). Books what leaves.
  std::vector<std::uint8_t> find_leaving();
  /// Throws NumericsError with the worst contact of the evaluation at the rows' present values, among the rows that
  /// `counts` (those that have not moved on since).
  [[noreturn]] void throw_overloaded(const std::function<bool(std::uint32_t)>& counts = [](std::uint32_t) { return true; }) const;
  /// Throws NumericsError for a ball that one step takes so far that it may pass through another. A list covers
  /// balls' ways for some steps ahead: looking when lists are made is enough.
  void require_slow() const;
  /// Takes the vertical velocity from `rows`, which feel a contact for the first time (paper, section 5.3), and books it.
  void stop_first_impacts(std::vector<std::uint32_t>& rows);
  /// Seconds from the start of the time line of this stepper to now.
  double elapsed() const { return static_cast<double>(steps_done_ - first_step_) * step_; }
  /// Gravity, domain, unit and coarsest step for the kernels.
  AdvanceParameters advance_parameters() const;
  Vec3 newtons(const IntVec& force) const {
    return scale_.unit * Vec3(static_cast<double>(force.v[0]), static_cast<double>(force.v[1]), static_cast<double>(force.v[2]));
  }
  /// Acceleration [m/s2] of a step that was opened by this force.
  Vec3 path_acceleration(std::uint32_t row, const IntVec& opening) const {
    return setup_.gravity + balls_.inverse_mass[row] * newtons(opening);
  }
  double mass(std::uint32_t row) const { return 1.0 / balls_.inverse_mass[row]; }
  SweepLaw law(bool fixed, double step) const { return sweep_law(setup_.materials, fixed, scale_, step); }
  /// Books `weight` seconds of the powers and wall forces of an evaluation.
  void book(const SweepTotals& ball_totals, const SweepTotals& fixed_totals, double weight);
  /// Adds the events' dissipation and impulses to the ledger and moves the balls by the position corrections.
  /// `force(row)` is the force sum [N] on the ball at its present position; without
  /// the dampers of the contacts at issue it says what energy a move costs.
  template <class Force>
  void apply_position_corrections(const EventBook& book, Force force);
  void book_gravity(double seconds) { ledger_.gravity_impulse += seconds * weight_; }

  StepperSetup setup_;
  Balls balls_;
  NeighbourList list_;
  ForceScale scale_;
  Ledger ledger_;
  Costs costs_;
  std::vector<BallRow> evaluated_;   // rows of the last evaluation that a restart or a renewal begins with
  std::vector<std::uint8_t> impacted_;  // per content row, only used with first_impact
  double length_scale_ = 0.0;
  double step_ = 0.0;
  std::int64_t steps_done_ = 0, first_step_ = 0;

  /// Level to report per content row; uniform: empty.
  virtual std::vector<std::uint8_t> levels() const { return {}; }
  /// Force of a contact to report [N]; `i` is content, and below `j` if both are.
  virtual double force_of(BallId /*i*/, BallId /*j*/, const ContactLaw& its, double overlap, double rate) const {
    return contact_force(its, overlap, rate);
  }

 private:
  /// Calls visit(row j, contact) for each contact, with fixed balls or between content, of the pairs of rows for which
  /// counts(i, j), in the order of the list.
  template <class Counts, class Visit>
  void for_each_contact(bool fixed, Counts counts, Visit visit) const;
  /// Contacts of the pairs of rows for which counts(i, j), in order of ids.
  template <class Counts>
  std::vector<Contact> contacts_where(Counts counts) const;
  void book_events(const EventBook& book);
  void weigh();
  void follow(const std::vector<std::uint32_t>& order);

  double start_time_ = 0.0;
  State fixed_;  // wall and plug, as given
  std::vector<std::pair<BallId, double>> masses_;  // kg, of the content, by id
  Vec3 weight_ = Vec3::Zero();                     // N, of the content
};

template <class Force>
void BallStepper::apply_position_corrections(const EventBook& book, Force force) {
  book_events(book);
  std::int64_t work = 0;  // an integer, so that the order does not matter
  for (const Shift& shift : shifts(book.entries())) {
    BallRow& row = balls_.rows[shift.row];
    const double per_unit = book.displacement_unit() * balls_.inverse_mass[shift.row];
    const Vec3 move(static_cast<double>(shift.displacement[0]) * per_unit,
                    static_cast<double>(shift.displacement[1]) * per_unit,
                    static_cast<double>(shift.displacement[2]) * per_unit);
    row.x += move.x();
    row.y += move.y();
    row.z += move.z();
    const Vec3 damping = scale_.unit * Vec3(static_cast<double>(shift.damping[0]), static_cast<double>(shift.damping[1]),
                                            static_cast<double>(shift.damping[2]));
    const Vec3 pull = force(shift.row) - damping + mass(shift.row) * setup_.gravity;
    work -= std::llround(pull.dot(move) / book.energy_unit());
  }
  ledger_.event_work += static_cast<double>(work) * book.energy_unit();
}

}  // namespace grainclock::core
