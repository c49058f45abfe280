/** \file
 * What a solver needs to know of a communication library: a table of functions, plain C.
 *
 * `#include <espalier/mpi.h>` fills it from the mpi.h of whoever compiles, so that this library was never built against
 * any MPI. Others fill it themselves.
 *
 * Ranks exchange messages, each from one rank to another. Messages from one rank to another arrive in the order in
 * which they were sent. All functions are called by the thread that calls the solver, and return at once
 * (MPI_THREAD_FUNNELED suffices). They return 0, or an error number that `explain` knows.
 */
#ifndef ESPALIER_RANKS_H
#define ESPALIER_RANKS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct espalier_rank_functions {
  size_t size;   /**< sizeof of this struct, as the caller compiled it */
  void* context; /**< handed to every function */
  int32_t rank;  /**< this rank, from 0 */
  int32_t ranks; /**< how many there are */
  /** Begins to send `bytes` bytes; `data` stays as it is until the request is done. */
  int (*send)(void* context, const void* data, size_t bytes, int32_t to, void** request);
  /** Whether a message has come that was not received yet: its sender (-1: none has) and its length. */
  int (*probe)(void* context, int32_t* from, size_t* bytes);
  /** Begins to receive the first message of `from` that was not received yet, `bytes` long as probe() said. */
  int (*receive)(void* context, void* data, size_t bytes, int32_t from, void** request);
  /** Whether a request is done (*done = 1); it is given back then. */
  int (*test)(void* context, void** request, int32_t* done);
  /** What an error number means, as text that ends in a zero. */
  void (*explain)(void* context, int error, char* text, size_t size);
  /** After an error: a rank that is known to be dead, -1: none is. May be null. */
  int32_t (*dead_rank)(void* context);
  /** The last call; it is left out when a rank was lost. Requests may be open: what they send or receive stays where it
   * is. */
  void (*release)(void* context);
} espalier_rank_functions;

#ifdef __cplusplus
}
#endif

#endif
