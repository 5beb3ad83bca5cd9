// Building lists and reordering balls takes no memory once warm.
#include "core/neighbours.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::size_t> g_allocations{0};

void* allocate(std::size_t size, std::size_t alignment) {
  ++g_allocations;
  // aligned_alloc() wants a multiple of the alignment.
  if (void* memory = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)) return memory;
  throw std::bad_alloc();
}

}  // namespace

// These replace the library's for the whole test program; all other forms call them.
[[gnu::noinline]] void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace grainclock::core {
namespace {

TEST(NeighbourList, AllocatesNothingOnceWarm) {
  tests::Random random(1);
  State state;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 v = random.between(0.0, 1.0) < 0.02 ? Vec3(0.0, 0.0, -5.0) : Vec3(0.1 * random.direction());
    state.add(i, i < 1800 ? Kind::content : Kind::wall, random.in_cube(3.0), i < 1800 ? v : Vec3::Zero(), 0.22);
  }
  for (const int threads : {1, 2}) {
    Balls balls(state, Materials{}, true);
    NeighbourList list(0.0, SkinRule{}, threads);
    std::vector<double> beside(balls.content_count());
    const auto build = [&] {
      for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
        balls.rows[i].x += random.between(-1e-3, 1e-3);
        balls.rows[i].y += random.between(-1e-3, 1e-3);
      }
      reorder_like(beside, list.build(balls), balls.spare);
    };
    for (int k = 0; k < 3; ++k) build();
    const std::size_t before = g_allocations;
    for (int k = 0; k < 20; ++k) build();
    EXPECT_EQ(g_allocations - before, 0u) << threads;
    // The counter counts.
    std::vector<int> more(10);
    EXPECT_EQ(g_allocations - before, 1u);
  }
}

}  // namespace
}  // namespace grainclock::core
