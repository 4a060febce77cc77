//! The same code, compiled for the vectors of the processor at hand. No operation changes, so no bit does.

/// Runs `work` compiled for the widest vectors here: of eight numbers with AVX-512, of four with AVX2, of two on ARM. It has to be
/// `#[inline(always)]`, with all functions that it calls often. Returns `None` on a processor without such vectors: on x86 before AVX2, and
/// in WebAssembly.
#[inline(always)]
pub fn with_vectors<R>(work: impl FnOnce() -> R) -> Option<R> {
    if !has_vectors() {
        return None;
    }
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn of_four<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        #[target_feature(enable = "avx2,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
        fn of_eight<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        let parts = [
            std::arch::is_x86_feature_detected!("avx512f"),
            std::arch::is_x86_feature_detected!("avx512bw"),
            std::arch::is_x86_feature_detected!("avx512cd"),
            std::arch::is_x86_feature_detected!("avx512dq"),
            std::arch::is_x86_feature_detected!("avx512vl"),
        ];
        // SAFETY: The processor has them.
        #[allow(unsafe_code)]
        Some(if parts == [true; 5] { unsafe { of_eight(work) } } else { unsafe { of_four(work) } })
    }
    #[cfg(not(target_arch = "x86_64"))]
    Some(work())
}

/// Whether [`with_vectors`] runs anything here.
pub fn has_vectors() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2");
    // Vectors of two numbers are part of every such processor.
    #[cfg(not(target_arch = "x86_64"))]
    return cfg!(target_arch = "aarch64");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_done_once_with_the_same_bits_or_not_at_all() {
        let numbers: [f64; 9] = std::array::from_fn(|i| 0.1 + i as f64);
        let work = || numbers.map(|x| (x * x + 0.3).sqrt() / x).map(f64::to_bits);
        let expected = has_vectors().then(work);
        let mut runs = 0;
        let counted = || {
            runs += 1;
            work()
        };
        assert_eq!(with_vectors(counted), expected);
        assert_eq!(runs, u32::from(has_vectors()));
    }
}
