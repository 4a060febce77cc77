//! Colours and lines of figures, as style sheets.

/// Colours and line styles of figures: Okabe and Ito's palette, on white and on near black.
pub const STYLE: &str = "\
svg.hapt{font:12px system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif}\
svg.hapt text{fill:#1b1e22}svg.hapt .soft{fill:#565d66}svg.hapt .bold{font-weight:600}\
svg.hapt .paper{fill:#fff}svg.hapt .node{fill:#eef1f4;stroke:#1b1e22}\
svg.hapt .frame{fill:none;stroke:#8a929b}svg.hapt .grid{fill:none;stroke:#e3e6ea}svg.hapt .zero{fill:none;stroke:#aab1b9}\
svg.hapt .ink{fill:none;stroke:#1b1e22;stroke-width:1.4;stroke-linejoin:round}svg.hapt .full{fill:#1b1e22}\
svg.hapt .band{fill:#d55e00;fill-opacity:.2}\
svg.hapt .line{fill:none;stroke-width:1.4;stroke-linejoin:round}svg.hapt .mark{fill:none;stroke-width:2}\
svg.hapt .s0{stroke:#0072b2}svg.hapt .s1{stroke:#d55e00}svg.hapt .s2{stroke:#009e73}svg.hapt .s3{stroke:#cc79a7}\
svg.hapt .s4{stroke:#e69f00;stroke-dasharray:7 2}svg.hapt .s5{stroke:#56b4e9;stroke-dasharray:7 2}\
svg.hapt .s6{stroke:#1b1e22;stroke-dasharray:7 2}\
svg.hapt .beneath{stroke:#e69f00;stroke-width:3.6}\
svg.hapt .d1{stroke-dasharray:2 2}svg.hapt .d2{stroke-dasharray:10 3 2 3}svg.hapt .d3{stroke-dasharray:1 4}\
svg.hapt .limit{stroke:#565d66;stroke-dasharray:7 4}svg.hapt .predicted{stroke:#1b1e22;stroke-dasharray:2 3;stroke-width:1.6}\
svg.hapt .guide{stroke:#8a929b}svg.hapt .cell{stroke:none}svg.hapt .none{fill:#c9ced4}\
svg.hapt .halo{fill:none;stroke:#fff;stroke-width:3.6}svg.hapt .edge{fill:none;stroke:#1b1e22;stroke-width:1.6}\
svg.hapt .m0{fill:#440154}svg.hapt .m1{fill:#472d7b}svg.hapt .m2{fill:#3b528b}svg.hapt .m3{fill:#2c728e}svg.hapt .m4{fill:#21918c}\
svg.hapt .m5{fill:#28ae80}svg.hapt .m6{fill:#5ec962}svg.hapt .m7{fill:#addc30}svg.hapt .m8{fill:#fde725}\
svg.hapt .n0{fill:#d6e6f4}svg.hapt .n1{fill:#9ac4e1}svg.hapt .n2{fill:#4a98c9}svg.hapt .n3{fill:#0b559f}\
svg.hapt .p0{fill:#fee3c8}svg.hapt .p1{fill:#fdb97d}svg.hapt .p2{fill:#f57622}svg.hapt .p3{fill:#a63603}\
@media screen and (prefers-color-scheme:dark){svg.hapt text{fill:#e7e9ec}svg.hapt .soft{fill:#a5adb6}\
svg.hapt .paper{fill:#15181c}svg.hapt .node{fill:#272c33;stroke:#e7e9ec}\
svg.hapt .frame{stroke:#6d757e}svg.hapt .grid{stroke:#2a2f35}svg.hapt .zero{stroke:#545b63}\
svg.hapt .ink{stroke:#e7e9ec}svg.hapt .full{fill:#e7e9ec}svg.hapt .band{fill-opacity:.38}\
svg.hapt .s0{stroke:#56b4e9}svg.hapt .s1{stroke:#e8702a}svg.hapt .s2{stroke:#1fb98d}svg.hapt .s5{stroke:#f0e442}\
svg.hapt .s6{stroke:#e7e9ec}svg.hapt .limit{stroke:#a5adb6}svg.hapt .predicted{stroke:#e7e9ec}svg.hapt .guide{stroke:#6d757e}}";

/// The line widths of a paper's figure, in 12ths of the type's size.
pub(crate) const THIN: &str = "\
svg.hapt .line{stroke-width:.9}svg.hapt .mark{stroke-width:1.2}svg.hapt .predicted{stroke-width:1}\
svg.hapt .beneath{stroke-width:2.4}svg.hapt .edge{stroke-width:1}svg.hapt .halo{stroke-width:2.4}\
svg.hapt .frame,svg.hapt .grid,svg.hapt .zero{stroke-width:.6}";
/// Those of a slide's.
pub(crate) const HEAVY: &str = "\
svg.hapt .line{stroke-width:2.6}svg.hapt .mark{stroke-width:3}svg.hapt .predicted{stroke-width:2.6}\
svg.hapt .beneath{stroke-width:6}svg.hapt .edge{stroke-width:2.8}svg.hapt .halo{stroke-width:5.6}\
svg.hapt .frame,svg.hapt .grid,svg.hapt .zero{stroke-width:1.3}";
