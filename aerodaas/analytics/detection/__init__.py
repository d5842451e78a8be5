"""Neural detectors in ONNX files: any export that people in this field use.

`aerodaas.analytics.detection.detector.OnnxDetector` is the analysis; `families` holds what is
particular to each kind of model.
"""
