// SUNDIALS' objects as owners that free them.
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_nonlinearsolver.h>

#include <memory>

namespace grainclock::benchmarks {

template <class T, void (*destroy)(T)>
struct Destroy {
  using pointer = T;
  void operator()(T it) const { destroy(it); }
};
template <class T, void (*destroy)(T)>
using Owned = std::unique_ptr<std::remove_pointer_t<T>, Destroy<T, destroy>>;

inline void free_context(SUNContext it) { SUNContext_Free(&it); }
inline void free_nonlinear_solver(SUNNonlinearSolver it) { SUNNonlinSolFree(it); }
inline void free_linear_solver(SUNLinearSolver it) { SUNLinSolFree(it); }

using Context = Owned<SUNContext, free_context>;
using Vector = Owned<N_Vector, N_VDestroy>;
using NonlinearSolver = Owned<SUNNonlinearSolver, free_nonlinear_solver>;
using LinearSolver = Owned<SUNLinearSolver, free_linear_solver>;

}  // namespace grainclock::benchmarks
