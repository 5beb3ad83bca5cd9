// The contact law as a pure function, one text for scalars and vectors alike
// (paper, Fig. 1 and Eqs. 4, 6, 7): spring and dashpot while balls overlap,
// a spring without memory while they part within the reach of cohesion.
#pragma once

namespace grainclock::core {

/// Law of one kind of pair, ready for evaluation.
struct ContactLaw {
  double k = 0.0;         // N/m
  double c = 0.0;         // N s/m
  double reach = 0.0;     // m, N_c / k; 0 without cohesion
  bool tension = false;   // the dashpot may pull while balls overlap
};

/// Which of the law's terms a scene uses: what is off is compiled out of the loop.
template <bool tension_v, bool cohesion_v>
struct Terms {
  static constexpr bool tension = tension_v;
  static constexpr bool cohesion = cohesion_v;
};

/// Force along the normal [N], positive when it pushes the balls apart.
/// `overlap` [m] is positive in contact, `rate` [m/s] its time derivative; Real is double or a vector of it.
template <class T, class Real>
[[gnu::always_inline]] inline Real contact_force(Real overlap, Real rate, double k, double c, double reach) {
  const Real zero = overlap - overlap;
  Real pressed = k * overlap + c * rate;
  if constexpr (!T::tension) pressed = pressed > zero ? pressed : zero;
  if constexpr (T::cohesion) {
    const Real pull = k * overlap;
    const Real parting = rate < zero ? pull : zero;
    return overlap > zero ? pressed : (overlap >= zero - reach ? parting : zero);
  } else {
    (void)reach;
    return overlap > zero ? pressed : zero;
  }
}

/// Energy stored in the spring [J]; cohesion has no memory and stores none.
inline double elastic_energy(const ContactLaw& law, double overlap) {
  return overlap > 0.0 ? 0.5 * law.k * overlap * overlap : 0.0;
}

/// The law for one pair, whatever its terms.
inline double contact_force(const ContactLaw& law, double overlap, double rate) {
  if (law.tension) {
    return law.reach > 0.0 ? contact_force<Terms<true, true>>(overlap, rate, law.k, law.c, law.reach)
                           : contact_force<Terms<true, false>>(overlap, rate, law.k, law.c, law.reach);
  }
  return law.reach > 0.0 ? contact_force<Terms<false, true>>(overlap, rate, law.k, law.c, law.reach)
                         : contact_force<Terms<false, false>>(overlap, rate, law.k, law.c, law.reach);
}

}  // namespace grainclock::core
