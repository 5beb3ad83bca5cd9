#include "silo/content.hpp"

#include <algorithm>

namespace grainclock::silo {

Content content_of(const core::State& state) {
  Content content;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::content) continue;
    content.ball.push_back(i);
    content.centre.push_back(state.position[i]);
    content.mean_diameter += 2.0 * state.radius[i];
    content.largest_radius = std::max(content.largest_radius, state.radius[i]);
  }
  if (!content.ball.empty()) content.mean_diameter /= static_cast<double>(content.ball.size());
  return content;
}

}  // namespace grainclock::silo
