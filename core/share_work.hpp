// Work shared among threads.
#pragma once

#include <cstddef>

namespace grainclock::core {

/// Calls work(t) for t from 0 to parts - 1, by as many threads.
template <class Work>
void share_work(int parts, Work work) {
  if (parts == 1) {
    work(0);
    return;
  }
#pragma omp parallel for num_threads(parts) schedule(static, 1)
  for (int t = 0; t < parts; ++t) work(t);
}

/// Calls work(t, begin, end) for about equal shares of 0 to n, by as many threads.
template <class Work>
void share_range(std::size_t n, int parts, Work work) {
  share_work(parts, [&](int t) {
    const auto first_of = [&](int part) { return n * static_cast<std::size_t>(part) / static_cast<std::size_t>(parts); };
    work(t, first_of(t), first_of(t + 1));
  });
}

}  // namespace grainclock::core
