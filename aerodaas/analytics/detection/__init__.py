"""Neural detectors in ONNX files, for the common export formats.

`aerodaas.analytics.detection.detector.OnnxDetector` is the analysis; `families` holds the
decoder of each kind of model.
"""
