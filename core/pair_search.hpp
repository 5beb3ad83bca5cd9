// Search for pairs among spheres that are sorted into cubes. A part of kernels.cpp, which includes it within its
// namespace, so that it is compiled once per instruction set; all list the same pairs in the same order.

/// One bit per sphere from `j` on that is the partner of the sphere at (x, y, z).
GC_INLINE unsigned partner_bits(const CubedSpheres& s, double x, double y, double z, double reach, std::uint32_t j) {
  const Real dx = *reinterpret_cast<const RealOut*>(s.x + j) - x;
  const Real dy = *reinterpret_cast<const RealOut*>(s.y + j) - y;
  const Real dz = *reinterpret_cast<const RealOut*>(s.z + j) - z;
  const Real range = *reinterpret_cast<const RealOut*>(s.reach + j) + reach;
#if defined(__AVX512F__)
  return _mm512_cmp_pd_mask((__m512d)(dx * dx + dy * dy + dz * dz), (__m512d)(range * range), _CMP_LE_OQ);
#else
  return lane_bits(dx * dx + dy * dy + dz * dz <= range * range);
#endif
}

/// Appends pairs of `i` and j + k for every bit k that is set.
GC_INLINE void append_pairs(unsigned bits, std::uint32_t i, std::uint32_t j, PairSearch& out) {
#if defined(__AVX512F__)
  const __m256i lanes = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(j)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
  const __m256i hits = _mm256_maskz_compress_epi32(static_cast<__mmask8>(bits), lanes);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.i + out.n), _mm256_set1_epi32(static_cast<int>(i)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.j + out.n), hits);
  out.n += static_cast<std::size_t>(__builtin_popcount(bits));
#else
  for (int k = 0; k < kWidth; ++k) {
    out.i[out.n] = i;
    out.j[out.n] = j + static_cast<std::uint32_t>(k);
    out.n += bits >> k & 1;
  }
#endif
}

/// The lowest `n` bits, all if n is kWidth or more.
GC_INLINE unsigned low_bits(std::uint32_t n) { return (1U << (n < kWidth ? n : kWidth)) - 1; }

void find_pairs(const CubedSpheres& spheres, PairSearch& search) {
  const CubedSpheres s = spheres;
  const std::size_t nx = static_cast<std::size_t>(s.size[0]), ny = static_cast<std::size_t>(s.size[1]);
  const std::size_t nz = static_cast<std::size_t>(s.size[2]);
  PairSearch out = search;
  for (; out.cube < out.end_cube; ++out.cube) {
    const std::uint32_t end_row = s.start[out.cube + 1];
    if (out.row == end_row) continue;
    const std::size_t x = out.cube % nx, y = out.cube / nx % ny, z = out.cube / (nx * ny);
    // Partners that come later: along x the cubes of a line are one run of spheres; the lines behind and above follow.
    struct Run {
      std::uint32_t begin, end;
    };
    const std::size_t before = x > 0 ? 1 : 0, behind = x + 1 < nx ? 1 : 0;
    const auto run = [&](bool exists, std::size_t middle) GC_INLINE_LAMBDA {
      return exists ? Run{s.start[middle - before], s.start[middle + behind + 1]} : Run{};
    };
    const std::size_t above = out.cube + nx * ny;
    const bool has_above = z + 1 < nz, has_back = y + 1 < ny;
    const Run later[4] = {run(has_back, out.cube + nx), run(has_above && y > 0, above - nx), run(has_above, above),
                          run(has_above && has_back, above + nx)};
    const std::uint32_t end_own = s.start[out.cube + behind + 1];
    std::size_t candidates = end_own - out.row;
    for (const Run& r : later) candidates += r.end - r.begin;
    for (; out.row < end_row; ++out.row) {
      const std::uint32_t i = out.row;
      out.wanted = out.n + candidates + kWidth;
      if (out.wanted > out.room) {
        search = out;
        return;
      }
      const double at_x = s.x[i], at_y = s.y[i], at_z = s.z[i], reach = s.reach[i];
      // The first vector of a run is mostly all of it.
      const auto find_in = [&](Run r) GC_INLINE_LAMBDA {
        append_pairs(partner_bits(s, at_x, at_y, at_z, reach, r.begin) & low_bits(r.end - r.begin), i, r.begin, out);
        for (std::uint32_t j = r.begin + kWidth; j < r.end; j += kWidth) {
          append_pairs(partner_bits(s, at_x, at_y, at_z, reach, j) & low_bits(r.end - j), i, j, out);
        }
      };
      find_in({i + 1, end_own});
      for (int r = 0; r < 4; ++r) find_in(later[r]);
    }
  }
  search = out;
}
