#include "core/ball_stepper.hpp"

#include "core/check.hpp"
#include "core/order_free_sum.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace grainclock::core {

namespace {

/// Rows in order of id, so that sums over balls do not depend on the sort in space.
std::vector<std::uint32_t> by_id(const Balls& balls) {
  std::vector<std::uint32_t> order(balls.content_count());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return balls.id[a] < balls.id[b]; });
  return order;
}

constexpr auto kAllRows = [](std::uint32_t, std::uint32_t) { return true; };

std::string point(const Vec3& x) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", x.x(), x.y(), x.z()); }

}  // namespace

BallStepper::BallStepper(const State& state, const StepperSetup& setup, int weight_bits, double ahead)
    : setup_(setup), balls_(state, setup.materials, !setup.outlet_open), ledger_(setup.ledger) {
  GC_REQUIRE(setup.stepping.step.has_value() && *setup.stepping.step > 0.0, "a stepper needs a step above 0 s");
  step_ = *setup.stepping.step;
  steps_done_ = first_step_ = setup.steps_done;
  start_time_ = state.time;
  length_scale_ = state.length_scale > 0.0 ? state.length_scale : balls_.mean_diameter;
  const std::size_t ever = balls_.content_count() + static_cast<std::size_t>(ledger_.discharged);
  scale_ = force_scale(setup.materials, setup.gravity.norm(), length_scale_, weight_bits, ever, setup.force_limit);
  SkinRule rule = SkinRule::for_diameter(length_scale_);
  rule.ahead = ahead;
  if (ahead > 0.0) rule.floor *= 3.0;  // only some steps sweep all listed pairs
  if (setup.skin > 0.0) rule.floor = setup.skin;
  list_ = NeighbourList(setup.materials.reach(), rule, setup.threads);

  impacted_.assign(balls_.content_count(), 0);
  std::uint32_t row = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) {
      fixed_.add(state.id[i], state.kind[i], state.position[i], Vec3::Zero(), state.radius[i]);
      continue;
    }
    if (!state.evaluated_position.empty()) {
      BallRow& r = balls_.rows[row];
      const Vec3& x = state.evaluated_position[i];
      const Vec3& v = state.evaluated_velocity[i];
      r = {x.x(), x.y(), x.z(), r.r, v.x(), v.y(), v.z(), 0.0};
    }
    if (!state.impacted.empty()) impacted_[row] = state.impacted[i];
    ++row;
  }
  for (const std::uint32_t k : by_id(balls_)) masses_.emplace_back(balls_.id[k], mass(k));
  weigh();
}

void BallStepper::weigh() {
  double total = 0.0;  // in order of id, so that it does not depend on the sort in space
  for (const auto& [id, its] : masses_) total += its;
  weight_ = total * setup_.gravity;
}

AdvanceParameters BallStepper::advance_parameters() const {
  const auto limit = [](const std::optional<Vec3>& value, int k, double otherwise) { return value ? (*value)[k] : otherwise; };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Domain& domain = setup_.domain;
  AdvanceParameters p{};
  for (int k = 0; k < 3; ++k) {
    p.gravity[k] = setup_.gravity[k];
    p.lower[k] = limit(domain.lower, k, -kInfinity);
    p.upper[k] = limit(domain.upper, k, kInfinity);
  }
  p.lower[2] = std::max(p.lower[2], domain.outlet_z.value_or(-kInfinity));
  p.unit = scale_.unit;
  p.step = step_;
  return p;
}

void BallStepper::load_synchronised(const State& state) {
  std::vector<std::uint32_t> order = by_id(balls_);
  auto next = order.begin();
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    BallRow& r = balls_.rows[*next++];
    const Vec3& x = state.position[i];
    const Vec3& v = state.velocity[i];
    r = {x.x(), x.y(), x.z(), r.r, v.x(), v.y(), v.z(), r.a};
  }
}

void BallStepper::build_list() {
  if (steps_done_ > first_step_) require_slow();  // a stepper may be made for its forces alone, whatever its step
  follow(list_.build(balls_));
}

void BallStepper::remove_balls(const std::vector<std::uint8_t>& leaving) {
  for (std::size_t row = 0; row < leaving.size(); ++row) {
    if (leaving[row] != 0) masses_.erase(std::lower_bound(masses_.begin(), masses_.end(), std::pair(balls_.id[row], 0.0)));
  }
  follow(list_.remove(balls_, leaving));
  keep_list_safe();
  weigh();
}

void BallStepper::keep_list_safe() {
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    const BallRow& r = balls_.rows[row];
    const SkinReference& skin = list_.skins()[row];
    const double dx = r.x - skin.x, dy = r.y - skin.y, dz = r.z - skin.z;
    if (dx * dx + dy * dy + dz * dz <= skin.skin2) continue;
    build_list();
    return;
  }
}

void BallStepper::follow(const std::vector<std::uint32_t>& order) {
  reorder_like(impacted_, order, balls_.spare, setup_.threads);
  if (!evaluated_.empty()) {
    reorder_like(evaluated_, order, balls_.spare, setup_.threads);
    evaluated_.insert(evaluated_.end(), balls_.rows.begin() + balls_.far_row(), balls_.rows.end());
  }
  follow_order(order);
}

State BallStepper::state() const {
  State out;
  out.time = start_time_ + elapsed();
  out.length_scale = length_scale_;
  const std::vector<std::uint8_t> level = levels();
  const bool restartable = is_checkpointable();
  std::size_t f = 0;
  const auto add_fixed = [&](std::size_t k) {
    out.add(fixed_.id[k], fixed_.kind[k], fixed_.position[k], Vec3::Zero(), fixed_.radius[k]);
    if (restartable) {
      out.evaluated_position.push_back(fixed_.position[k]);
      out.evaluated_velocity.push_back(Vec3::Zero());
    }
    out.level.push_back(0);
    out.impacted.push_back(0);
  };
  for (const std::uint32_t row : by_id(balls_)) {
    while (f < fixed_.size() && fixed_.id[f] < balls_.id[row]) add_fixed(f++);
    const BallRow& r = balls_.rows[row];
    out.add(balls_.id[row], Kind::content, position(r), velocity(r), r.r);
    if (restartable) {
      out.evaluated_position.push_back(position(evaluated_[row]));
      out.evaluated_velocity.push_back(velocity(evaluated_[row]));
    }
    out.level.push_back(level.empty() ? std::uint8_t{0} : level[row]);
    out.impacted.push_back(impacted_[row]);
  }
  while (f < fixed_.size()) add_fixed(f++);
  return out;
}

template <class Counts, class Visit>
void BallStepper::for_each_contact(bool fixed, Counts counts, Visit visit) const {
  const PairList& pairs = fixed ? list_.fixed_pairs() : list_.ball_pairs();
  const ContactLaw its = law(fixed, 0.0).law;
  for (std::size_t p = 0; p < pairs.count; ++p) {
    if (!counts(pairs.i[p], pairs.j[p])) continue;
    const BallRow& a = balls_.rows[pairs.i[p]];
    const BallRow& b = balls_.rows[pairs.j[p]];
    const Vec3 d = position(a) - position(b);
    const double distance = d.norm(), overlap = a.r + b.r - distance;
    if (overlap <= -its.reach) continue;
    const double rate = -d.dot(velocity(a) - velocity(b)) / distance;
    const BallId id_i = balls_.id_of(pairs.i[p]), id_j = balls_.id_of(pairs.j[p]);
    const bool swapped = !fixed && id_i > id_j;
    const double force = swapped ? force_of(id_j, id_i, its, overlap, rate) : force_of(id_i, id_j, its, overlap, rate);
    if (overlap <= 0.0 && force == 0.0) continue;
    Contact c{id_i, id_j, balls_.kind_of(pairs.j[p]), overlap, rate, force / distance * d};
    if (swapped) {
      std::swap(c.i, c.j);
      c.force = -c.force;
    }
    visit(pairs.j[p], c);
  }
}

template <class Counts>
std::vector<Contact> BallStepper::contacts_where(Counts counts) const {
  std::vector<Contact> out;
  for (const bool fixed : {false, true})
    for_each_contact(fixed, counts, [&](std::uint32_t, const Contact& contact) { out.push_back(contact); });
  std::sort(out.begin(), out.end(), [](const Contact& a, const Contact& b) { return std::tie(a.i, a.j) < std::tie(b.i, b.j); });
  return out;
}

std::vector<Contact> BallStepper::contacts() const { return contacts_where(kAllRows); }

Energies BallStepper::energies() const {
  Energies e;
  for (const std::uint32_t row : by_id(balls_)) {
    const BallRow& r = balls_.rows[row];
    e.kinetic += 0.5 * mass(row) * velocity(r).squaredNorm();
    e.gravity -= mass(row) * setup_.gravity.dot(position(r));
    e.momentum += mass(row) * velocity(r);
  }
  for (const Contact& c : contacts()) {
    e.elastic += elastic_energy(law(c.other != Kind::content, 0.0).law, c.overlap);
  }
  return e;
}

double BallStepper::kinetic_energy() const {
  return order_free_sum(balls_.content_count(), [this](std::uint32_t row) {
    const BallRow& r = balls_.rows[row];
    return 0.5 * mass(row) * (r.vx * r.vx + r.vy * r.vy + r.vz * r.vz);
  });
}

Vec3 BallStepper::momentum() const {
  return order_free_vector_sum(balls_.content_count(), [this](std::uint32_t row) -> Vec3 { return mass(row) * velocity(balls_.rows[row]); });
}

std::vector<FixedForce> BallStepper::fixed_forces() const {
  // Whole force units, as in the sweeps: the sums do not depend on the order of the pairs.
  const double per_unit = 1.0 / scale_.unit;
  std::vector<IntVec> sums(balls_.fixed_count());
  for_each_contact(true, kAllRows, [&](std::uint32_t fixed, const Contact& contact) {
    for (int k = 0; k < 3; ++k) sums[fixed - balls_.first_fixed_row()].v[k] -= std::llrint(contact.force[k] * per_unit);
  });
  std::vector<FixedForce> out;
  for (std::uint32_t k = 0; k < balls_.fixed_count(); ++k) out.push_back({balls_.fixed_id[k], newtons(sums[k])});
  return out;
}

Costs BallStepper::costs() const {
  Costs out = costs_;
  out.list_builds += list_.builds();
  return out;
}

std::vector<std::uint8_t> BallStepper::find_leaving() {
  const Domain& domain = setup_.domain;
  std::vector<std::uint8_t> leaving;
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    const BallRow& r = balls_.rows[row];
    const Vec3 x = position(r);
    if (!x.allFinite() || !velocity(r).allFinite()) {
      throw NumericsError(fmt::format(
          "ball {} is at {} m with velocity {} m/s at t = {:.6g} s: the numbers are no longer finite; use a smaller step "
          "(now {:.3g} s)",
          balls_.id[row], point(x), point(velocity(r)), start_time_ + elapsed(), step_), {balls_.id[row]});
    }
    if (domain.outlet_z && x.z() < *domain.outlet_z) {
      if (leaving.empty()) leaving.assign(balls_.content_count(), 0);
      leaving[row] = 1;
      continue;
    }
    if ((domain.lower && (x.array() < domain.lower->array()).any()) ||
        (domain.upper && (x.array() > domain.upper->array()).any())) {
      throw NumericsError(fmt::format(
          "ball {} left the domain at {} m with velocity {} m/s at t = {:.6g} s, not through the outlet: a hole in the "
          "wall, a ball over the rim, or a step too large (now {:.3g} s); check the geometry, [domain] and the step",
          balls_.id[row], point(x), point(velocity(r)), start_time_ + elapsed(), step_), {balls_.id[row]});
    }
  }
  if (leaving.empty()) return leaving;
  // In order of id, so that the sums do not depend on the sort in space.
  std::vector<std::uint32_t> gone;
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    if (leaving[row] != 0) gone.push_back(row);
  }
  std::sort(gone.begin(), gone.end(), [&](std::uint32_t a, std::uint32_t b) { return balls_.id[a] < balls_.id[b]; });
  for (const std::uint32_t row : gone) {
    const BallRow& r = balls_.rows[row];
    ++ledger_.discharged;
    ledger_.removed_momentum += mass(row) * velocity(r);
    ledger_.removed_energy += mass(row) * (0.5 * velocity(r).squaredNorm() - setup_.gravity.dot(position(r)));
  }
  const auto leaves = [&](std::uint32_t row) { return row < balls_.content_count() && leaving[row] != 0; };
  for (const Contact& c : contacts_where([&](std::uint32_t i, std::uint32_t j) { return leaves(i) || leaves(j); })) {
    ledger_.removed_energy += elastic_energy(law(c.other != Kind::content, 0.0).law, c.overlap);
  }
  return leaving;
}

void BallStepper::throw_overloaded(const std::function<bool(std::uint32_t)>& counts) const {
  double worst = -1.0;
  std::vector<BallId> at;
  std::string text = "a contact force is not finite";
  for (const bool fixed : {false, true}) {
    const PairList& pairs = fixed ? list_.fixed_pairs() : list_.ball_pairs();
    const ContactLaw its = law(fixed, 0.0).law;
    for (std::size_t p = 0; p < pairs.count; ++p) {
      if (!counts(pairs.i[p]) || !counts(pairs.j[p])) continue;
      const BallRow& a = balls_.rows[pairs.i[p]];
      const BallRow& b = balls_.rows[pairs.j[p]];
      const Vec3 d = position(a) - position(b);
      const double overlap = a.r + b.r - d.norm();
      const double rate = -d.dot(velocity(a) - velocity(b)) / d.norm();
      const double force = std::abs(contact_force(its, overlap, rate));
      const double excess = std::max(force / scale_.limit, 4.0 * overlap / (a.r + b.r));
      if (excess < worst) continue;
      if (std::isfinite(excess)) worst = excess;
      at = {balls_.id_of(pairs.i[p]), balls_.id_of(pairs.j[p])};
      text = fmt::format("ball {} at {} m, velocity {} m/s, against {} {}: force {:.3g} N (limit {:.3g}), overlap {:.3g} m "
                         "(limit {:.3g}), rate {:.3g} m/s",
                         balls_.id_of(pairs.i[p]), point(position(a)), point(velocity(a)),
                         balls_.kind_of(pairs.j[p]) == Kind::content ? "ball" : name(balls_.kind_of(pairs.j[p])),
                         balls_.id_of(pairs.j[p]), force, scale_.limit, overlap, (a.r + b.r) / 4.0, rate);
      if (!std::isfinite(excess)) break;
    }
  }
  throw NumericsError(fmt::format("blow-up in the step that began at t = {:.6g} s (step {:.3g} s): {}; use a smaller step",
                                  start_time_ + elapsed(), step_, text),
                      at);
}

void BallStepper::require_slow() const {
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    const BallRow& r = balls_.rows[row];
    const double stride = velocity(r).norm() * step_;
    if (!(stride > 0.5 * r.r)) continue;  // what is not finite shows in the forces
    throw NumericsError(
        fmt::format("ball {} at {} m with velocity {} m/s at t = {:.6g} s moves by {:.3g} m in a step {:.3g} s long, more than half its "
                    "radius of {:.3g} m: it may pass through others unseen; use a smaller step, or look for what made it so fast",
                    balls_.id[row], point(position(r)), point(velocity(r)), start_time_ + elapsed(), stride, step_, r.r),
        {balls_.id[row]});
  }
}

void BallStepper::stop_first_impacts(std::vector<std::uint32_t>& rows) {
  // In order of id, so that the ledger does not depend on the sort in space.
  std::sort(rows.begin(), rows.end(), [this](std::uint32_t a, std::uint32_t b) { return balls_.id[a] < balls_.id[b]; });
  for (const std::uint32_t row : rows) {
    BallRow& ball = balls_.rows[row];
    impacted_[row] = 1;
    ledger_.first_impact += 0.5 * mass(row) * ball.vz * ball.vz;
    ledger_.first_impact_impulse.z() -= mass(row) * ball.vz;
    ball.vz = 0.0;
  }
}

void BallStepper::book_events(const EventBook& book) {
  std::int64_t dissipated = 0, magnitude = 0, wall[3] = {0, 0, 0};
  for (const EventBook::Entry& e : book.entries()) {
    dissipated += e.dissipated;
    magnitude += e.magnitude;
    if (e.both) continue;
    for (int k = 0; k < 3; ++k) wall[k] += e.impulse[k];
  }
  ledger_.dissipated += static_cast<double>(dissipated) * book.energy_unit();
  ledger_.total_impulse += static_cast<double>(magnitude) * book.energy_unit();
  for (int k = 0; k < 3; ++k) ledger_.wall_impulse[k] += static_cast<double>(wall[k]) * book.impulse_unit();
  costs_.events += book.entries().size();
}

void BallStepper::book(const SweepTotals& ball_totals, const SweepTotals& fixed_totals, double weight) {
  const double total = scale_.total * weight, unit = scale_.unit * weight;
  ledger_.dissipated += static_cast<double>(ball_totals.power + fixed_totals.power) * total;
  ledger_.turned_over += static_cast<double>(ball_totals.turned + fixed_totals.turned) * total;
  ledger_.total_impulse += static_cast<double>(ball_totals.magnitude + fixed_totals.magnitude) * total;
  for (int k = 0; k < 3; ++k) ledger_.wall_impulse[k] += static_cast<double>(fixed_totals.force[k]) * unit;
}

}  // namespace grainclock::core
