"""A million loops of one body under forward Euler by NumPy: the eigenvalues of their matrices, as one array.

Prints `ns`, the median time of a loop, and the largest relative error of the growth against ln(1 + x^2)/(2T).
"""

import statistics
import sys
import time

import numpy as np

T, SIDE = 1e-3, 1000
k, J = (a.ravel() for a in np.meshgrid(np.linspace(0.5, 2, SIDE), np.linspace(0.01, 0.05, SIDE), indexing="ij"))
times = []
for _ in range(int(sys.argv[1])):
    start = time.perf_counter()
    A = np.empty((k.size, 2, 2))
    A[:, 0, 0] = A[:, 1, 1] = 1
    A[:, 0, 1], A[:, 1, 0] = T, -T * k / J
    growth = np.log(np.abs(np.linalg.eigvals(A)).max(axis=1)) / T
    times.append(1e9 * (time.perf_counter() - start) / k.size)
exact = np.log1p(T * T * k / J) / (2 * T)
print("ns", statistics.median(times))
print(np.max(np.abs(growth / exact - 1)))
